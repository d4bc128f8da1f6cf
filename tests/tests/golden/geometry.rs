//! Golden cases c01 (contraction, PCA), c02 (hexplane), c03 (deformation) on every back end.

use burn::module::Param;
use burn::nn::Linear;
use burn::tensor::{Device, Tensor, s};
use light4gs_codec::CoordinateMapping;
use light4gs_codec::plane_layout::PlaneAxes;
use light4gs_model::{
    Deformation, DeformationConfig, DeformationHead, DynamicScene, FeaturePlanes, GaussianTensors, Gaussians,
    HexPlaneField, Pca, PlaneTensors, SceneCoordinates,
};
use light4gs_tests::golden::{Golden, assert_close, assert_close_relative, devices, values_of};

/// World coordinates, contracted.
fn contracted_world(device: &Device) -> SceneCoordinates {
    let identity = Pca { mean: [0.0; 3], axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], std: [1.0; 3] };
    unscaled(&identity, true, device)
}

/// Standardized coordinates, contracted or not, neither scaled nor moved.
fn unscaled(pca: &Pca, contracts: bool, device: &Device) -> SceneCoordinates {
    let mapping = CoordinateMapping { contracts, scale: [1.0; 3], ..CoordinateMapping::default() };
    SceneCoordinates::new(pca, device).with_mapping(mapping)
}

#[test]
fn contraction() {
    let golden = Golden::open("c01_contract_pca");
    for (name, device) in devices() {
        let device = device.autodiff();
        let x = golden.tensor::<2>("contract.x", &device).require_grad();
        let out = contracted_world(&device).normalize(x.clone());
        assert_close(&format!("{name} contract.out"), &values_of(&out), &golden.values("contract.out"), 1e-5);
        let grads = (out * golden.tensor("contract.w", &device)).sum().backward();
        let gradient = values_of(&x.grad(&grads).unwrap());
        assert_close_relative(&format!("{name} contract.grad_x"), &gradient, &golden.values("contract.grad_x"), 1e-4);
    }
}

fn triples(values: Vec<f32>) -> Vec<[f32; 3]> {
    values.as_chunks().0.to_vec()
}

fn pca_of(golden: &Golden) -> Pca {
    let columns = golden.values("pca.eigvecs_cols");
    let triple = |name: &str| triples(golden.values(name))[0];
    Pca {
        mean: triple("pca.mean"),
        axes: std::array::from_fn(|j| [columns[j], columns[3 + j], columns[6 + j]]),
        std: triple("pca.std"),
    }
}

#[test]
fn principal_axes() {
    let golden = Golden::open("c01_contract_pca");
    let found = Pca::fit(&triples(golden.values("pca.points")));
    let expected = pca_of(&golden);
    assert_close_relative("mean", &found.mean, &expected.mean, 1e-4);
    assert_close_relative("std", &found.std, &expected.std, 1e-4);
    assert_close("axes", &found.axes.concat(), &expected.axes.concat(), 1e-4);
}

#[test]
fn scene_coordinates() {
    let golden = Golden::open("c01_contract_pca");
    for (name, device) in devices() {
        let device = device.autodiff();
        let frame = SceneCoordinates::new(&pca_of(&golden), &device);
        let points = golden.tensor::<2>("pca.points", &device).require_grad();
        let standardised = values_of(&unscaled(&pca_of(&golden), false, &device).normalize(points.clone()));
        assert_close(&format!("{name} standardised"), &standardised, &golden.values("pca.standardised"), 1e-5);
        let out = frame.normalize(points.clone());
        assert_close(&format!("{name} paper.out_half"), &values_of(&out), &golden.values("paper.out_half"), 1e-5);
        let grads = (out * 2.0 * golden.tensor("paper.w", &device)).sum().backward();
        let gradient = values_of(&points.grad(&grads).unwrap());
        assert_close_relative(
            &format!("{name} paper.grad_points"),
            &gradient,
            &golden.values("paper.grad_points"),
            1e-4,
        );
    }
}

fn scales_of(golden: &Golden, prefix: &str) -> usize {
    (0..).find(|s| !golden.has(&format!("{prefix}scale{s}.plane0"))).unwrap()
}

pub(super) fn hexplane_of(golden: &Golden, prefix: &str, device: &Device) -> FeaturePlanes {
    let scales = scales_of(golden, prefix);
    let names = (0..scales).flat_map(|s| (0..6).map(move |p| format!("{prefix}scale{s}.plane{p}")));
    let planes = names.map(|name| golden.tensor::<3>(&name, device)).collect();
    FeaturePlanes::from_tensors(PlaneTensors::at_scales(&PlaneAxes::ALL, planes))
}

#[test]
fn hexplane_query() {
    let golden = Golden::open("c02_hexplane");
    for (name, device) in devices() {
        let device = device.autodiff();
        let hexplane = hexplane_of(&golden, "", &device);
        let points = golden.tensor::<2>("direct.pts", &device).require_grad();
        let out = hexplane.query(points.clone());
        assert_close_relative(&format!("{name} direct.out"), &values_of(&out), &golden.values("direct.out"), 1e-5);
        let edge = hexplane.query(golden.tensor("edge.pts", &device));
        assert_close_relative(&format!("{name} edge.out"), &values_of(&edge), &golden.values("edge.out"), 1e-5);

        let grads = (out * golden.tensor("direct.w", &device)).sum().backward();
        let gradient = values_of(&points.grad(&grads).unwrap());
        assert_close_relative(&format!("{name} direct.grad_pts"), &gradient, &golden.values("direct.grad_pts"), 1e-4);
        for (i, plane) in hexplane.planes.iter().enumerate() {
            let key = format!("direct.grad.scale{}.plane{}", i / 6, i % 6);
            let gradient = values_of(&plane.val().grad(&grads).unwrap());
            assert_close_relative(&format!("{name} {key}"), &gradient, &golden.values(&key), 1e-4);
        }
    }
}

/// Our mapping to the planes: `paper.*` of c02.
#[test]
fn hexplane_query_in_scene_coordinates() {
    let golden = Golden::open("c02_hexplane");
    let rotation = golden.values("ref.rotation");
    let pca = Pca {
        mean: triples(golden.values("ref.mean"))[0],
        axes: std::array::from_fn(|j| [rotation[j], rotation[3 + j], rotation[6 + j]]),
        std: triples(golden.values("ref.std"))[0],
    };
    for (name, device) in devices() {
        let device = device.autodiff();
        let hexplane = hexplane_of(&golden, "", &device);
        let xyz = golden.tensor::<2>("ref.xyz", &device).require_grad();
        let time = golden.tensor::<2>("ref.t", &device) * 2.0 - 1.0;
        let points = Tensor::cat(vec![SceneCoordinates::new(&pca, &device).normalize(xyz.clone()), time], 1);
        let out = hexplane.query(points);
        assert_close_relative(&format!("{name} paper.out"), &values_of(&out), &golden.values("paper.out"), 1e-5);
        let grads = (out * golden.tensor("ref.w", &device)).sum().backward();
        let gradient = values_of(&xyz.grad(&grads).unwrap());
        assert_close_relative(&format!("{name} paper.grad_xyz"), &gradient, &golden.values("paper.grad_xyz"), 1e-4);
    }
}

/// The layers of a golden network, each with the key that it was read from.
struct GoldenNetwork {
    network: Deformation,
    layers: Vec<(String, Linear)>,
}

fn network_of(golden: &Golden, prefix: &str, device: &Device) -> GoldenNetwork {
    let mut layers = Vec::new();
    let mut linear = |key: String| {
        let [outputs, inputs] = golden.shape(&format!("{prefix}.param.{key}.weight"))[..] else { panic!("2-D weight") };
        let mut layer = burn::nn::LinearConfig::new(inputs, outputs).init(device);
        let weight = golden.tensor::<2>(&format!("{prefix}.param.{key}.weight"), device);
        layer.weight = Param::from_tensor(Tensor::from_data(weight.transpose().into_data(), device));
        layer.bias = Some(Param::from_tensor(golden.tensor::<1>(&format!("{prefix}.param.{key}.bias"), device)));
        layers.push((key, layer.clone()));
        layer
    };
    let has = |key: &str| golden.has(&format!("{prefix}.param.{key}.weight"));
    let mut trunk = Vec::new();
    while has(&format!("feature_out.{}", 2 * trunk.len())) {
        trunk.push(linear(format!("feature_out.{}", 2 * trunk.len())));
    }
    let mut head = |key: &str| {
        has(&format!("{key}.1"))
            .then(|| DeformationHead { hidden: linear(format!("{key}.1")), output: linear(format!("{key}.3")) })
    };
    let network = Deformation {
        trunk,
        position: head("pos_deform"),
        scale: head("scales_deform"),
        rotation: head("rotations_deform"),
        opacity: head("opacity_deform"),
        sh: head("shs_deform"),
    };
    GoldenNetwork { network, layers }
}

#[test]
fn deformation() {
    let golden = Golden::open("c03_deform");
    for (name, device) in devices() {
        let device = device.autodiff();
        for depth in 0..3 {
            let prefix = format!("depth{depth}");
            let GoldenNetwork { network, layers } = network_of(&golden, &prefix, &device);
            assert_eq!(
                DeformationConfig { depth, ..Default::default() }.init(1, &device).trunk.len(),
                network.trunk.len()
            );
            let features = golden.tensor::<2>(&format!("{prefix}.feat"), &device).require_grad();
            let check = |key: &str, found: &[f32]| {
                let key = format!("{prefix}.{key}");
                assert_close_relative(&format!("{name} {key}"), found, &golden.values(&key), 1e-5);
            };
            check("hidden", &values_of(&network.hidden(features.clone())));
            let offsets = network.forward(features.clone());
            let mut loss = Tensor::<1>::zeros([1], &device);
            let outputs =
                [("dx", offsets.position), ("ds", offsets.scale), ("dr", offsets.rotation), ("do", offsets.opacity)];
            for (key, output) in outputs {
                assert_eq!(output.is_some(), golden.has(&format!("{prefix}.out.{key}")), "{prefix} {key}");
                if let Some(output) = output {
                    check(&format!("out.{key}"), &values_of(&output));
                    loss = loss + (output * golden.tensor(&format!("{prefix}.w.{key}"), &device)).sum();
                }
            }
            if let Some(output) = offsets.sh {
                check("out.dshs", &values_of(&output));
                let weights = golden.tensor::<2>(&format!("{prefix}.w.dshs"), &device).reshape(output.dims());
                loss = loss + (output * weights).sum();
            }
            let grads = loss.backward();
            check("grad_feat", &values_of(&features.grad(&grads).unwrap()));
            for (key, layer) in &layers {
                let weight = layer.weight.val().grad(&grads).unwrap().transpose();
                check(&format!("grad.{key}.weight"), &values_of(&weight));
                check(
                    &format!("grad.{key}.bias"),
                    &values_of(&layer.bias.as_ref().unwrap().val().grad(&grads).unwrap()),
                );
            }
        }
    }
}

/// The reference's coordinates, which differ from ours: a box around the points, then the contraction, then a quarter
/// of the result plus one half. `[N, 4]` in [0, 1] for space and in [-1, 1] for time.
fn reference_query_points(golden: &Golden, xyz: Tensor<2>, device: &Device) -> Tensor<2> {
    let count = xyz.dims()[0];
    let (low, high) = (golden.tensor::<2>("full.aabb_min", device), golden.tensor::<2>("full.aabb_max", device));
    let boxed = (xyz - low.clone()) / (high - low) * 2.0 - 1.0;
    let time = golden.tensor::<2>("full.t", device).expand([count, 1]) * 2.0 - 1.0;
    Tensor::cat(vec![contracted_world(device).normalize(boxed) / 4.0 + 0.5, time], 1)
}

/// Planes, network and attributes together: `full.*` of c03, whose network is that of depth 1.
#[test]
fn deformed_gaussians() {
    let golden = Golden::open("c03_deform");
    for (name, device) in devices() {
        let device = device.autodiff();
        let shs = golden.tensor::<3>("full.in.shs", &device);
        let [count, coefficients, _] = shs.dims();
        let gaussians = Gaussians::from_tensors(GaussianTensors {
            means: golden.tensor("full.in.xyz", &device),
            log_scales: golden.tensor("full.in.scales", &device),
            quats: golden.tensor("full.in.rotations", &device),
            opacity_logits: golden.tensor("full.in.opacity", &device),
            sh_dc: shs.clone().slice(s![.., 0..1, ..]),
            sh_rest: shs.slice(s![.., 1..coefficients, ..]),
            further: Vec::new(),
        });
        let GoldenNetwork { network, layers } = network_of(&golden, "depth1", &device);
        let scene = DynamicScene {
            gaussians,
            coordinates: contracted_world(&device),
            field: HexPlaneField { hexplane: hexplane_of(&golden, "full.", &device), deformation: network },
            differentiate_points: false,
        };
        let rest = scene.gaussians.tensors();
        let points = reference_query_points(&golden, rest.means.clone().detach(), &device);
        let moved = rest.clone().offset_by(scene.field.deformation.forward(scene.field.hexplane.query(points)));

        let check = |key: &str, found: &[f32]| {
            let key = format!("full.{key}");
            assert_close_relative(&format!("{name} {key}"), found, &golden.values(&key), 1e-5);
        };
        let moved_shs = Tensor::cat(vec![moved.sh_dc, moved.sh_rest], 1);
        let outputs = [
            ("xyz", moved.means),
            ("scales", moved.log_scales),
            ("rotations", moved.quats),
            ("opacity", moved.opacity_logits),
            ("shs", moved_shs.reshape([count, 3 * coefficients])),
        ];
        let mut loss = Tensor::<1>::zeros([1], &device);
        for (key, output) in outputs {
            check(&format!("out.{key}"), &values_of(&output));
            let weights = golden.values(&format!("full.w.{key}"));
            let weights = Tensor::<1>::from_floats(&weights[..], &device).reshape(output.dims());
            loss = loss + (output * weights).sum();
        }
        // A sum of numbers that cancel each other.
        assert_close_relative(&format!("{name} loss"), &values_of(&loss), &golden.values("full.loss"), 1e-4);

        let grads = loss.backward();
        let gradient = |tensor: &Tensor<2>| values_of(&tensor.grad(&grads).unwrap());
        check("grad.xyz", &gradient(&rest.means));
        assert_close(&format!("{name} xyz detached"), &gradient(&rest.means), &golden.values("full.w.xyz"), 0.0);
        check("grad.scales", &gradient(&rest.log_scales));
        check("grad.rotations", &gradient(&rest.quats));
        check("grad.opacity", &gradient(&rest.opacity_logits));
        let (dc, other) = (rest.sh_dc.grad(&grads).unwrap(), rest.sh_rest.grad(&grads).unwrap());
        check("grad.shs", &values_of(&Tensor::cat(vec![dc, other], 1)));
        for (i, plane) in scene.field.hexplane.planes.iter().enumerate() {
            let key = format!("grad.scale{}.plane{}", i / 6, i % 6);
            check(&key, &values_of(&plane.val().grad(&grads).unwrap()));
        }
        assert!(layers.iter().all(|(_, layer)| layer.weight.val().grad(&grads).is_some()));
    }
}
