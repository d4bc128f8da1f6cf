//! Golden cases c09 (losses, metrics, regularizers), c10 (Adam, learning rates), c11 (densification) on every back end.

use burn::module::Param;
use burn::tensor::{Device, Int, Tensor, TensorData, s};
use light4gs_codec::plane_layout::PlaneAxes;
use light4gs_data::PointCloud;
use light4gs_model::{
    FeaturePlanes, GaussianTensors, Gaussians, GaussiansConfig, PlaneTensors, regularizer::PlaneRegularizer,
};
use light4gs_tests::golden::{Golden, assert_close, assert_close_relative, devices, values_of};
use light4gs_train::density::clone_and_split::{
    DensifyMasks, SizeLimit, densify, largest_scales, reset_opacity, survivors,
};
use light4gs_train::density::{DensityStatistics, GaussianEditor};
use light4gs_train::loss::photometric;
use light4gs_train::metrics::{l1, l2, psnr, ssim};
use light4gs_train::optimization::adam::{Adam, AdamState};
use light4gs_train::optimization::schedule::ExponentialDecay;

/// One image `[H, W, 3]` of a batch `[B, 3, H, W]`.
fn image_of(batch: &Tensor<4>, index: usize) -> Tensor<3> {
    batch.clone().slice(s![index..index + 1, .., .., ..]).squeeze_dim::<3>(0).permute([1, 2, 0])
}

/// Mean over the images of a batch of a loss on pairs of images: `[1]`.
fn batch_mean(image: &Tensor<4>, truth: &Tensor<4>, loss: impl Fn(Tensor<3>, Tensor<3>) -> Tensor<1>) -> Tensor<1> {
    let count = image.dims()[0];
    let losses: Vec<_> = (0..count).map(|i| loss(image_of(image, i), image_of(truth, i))).collect();
    Tensor::cat(losses, 0).mean()
}

#[test]
fn image_losses() {
    let golden = Golden::open("c09_losses");
    for (name, device) in devices() {
        let device = device.autodiff();
        let image = golden.tensor::<4>("img", &device).require_grad();
        let truth = golden.tensor::<4>("gt", &device);
        let check = |key: &str, loss: Tensor<1>| {
            let value = golden.values(&format!("{key}.value"));
            assert_close(&format!("{name} {key}.value"), &values_of(&loss), &value, 1e-5);
            let gradient = values_of(&image.grad(&loss.backward()).unwrap());
            let key = format!("{key}.grad");
            assert_close_relative(&format!("{name} {key}"), &gradient, &golden.values(&key), 1e-4);
        };
        check("l1", batch_mean(&image, &truth, l1));
        check("l2", batch_mean(&image, &truth, l2));
        check("ssim", batch_mean(&image, &truth, ssim));
        // The reference adds D-SSIM to L1 with its full weight.
        check(
            "l1_plus_02dssim",
            batch_mean(&image, &truth, |a, b| l1(a.clone(), b.clone()) + (-ssim(a, b) + 1.0) * 0.2),
        );

        let similarities: Vec<f32> =
            (0..image.dims()[0]).flat_map(|i| values_of(&ssim(image_of(&image, i), image_of(&truth, i)))).collect();
        assert_close(&format!("{name} ssim.per_image"), &similarities, &golden.values("ssim.per_image"), 1e-5);
    }
}

/// The golden value is `L1 + lambda (1 - SSIM)`. Our training loss `(1 - lambda) L1 + lambda (1 - SSIM)` is that value
/// minus `lambda L1`.
#[test]
fn photometric_loss() {
    let golden = Golden::open("c09_losses");
    let less = |whole: &str, part: &str| -> Vec<f32> {
        golden.values(whole).iter().zip(golden.values(part)).map(|(w, p)| w - 0.2 * p).collect()
    };
    for (name, device) in devices() {
        let device = device.autodiff();
        let image = golden.tensor::<4>("img", &device).require_grad();
        let truth = golden.tensor::<4>("gt", &device);
        let loss = batch_mean(&image, &truth, |a, b| photometric(a, b, 0.2));
        let expected = less("l1_plus_02dssim.value", "l1.value");
        assert_close(&format!("{name} value"), &values_of(&loss), &expected, 1e-5);
        let gradient = values_of(&image.grad(&loss.backward()).unwrap());
        assert_close_relative(&format!("{name} grad"), &gradient, &less("l1_plus_02dssim.grad", "l1.grad"), 1e-4);

        let loss = batch_mean(&image, &truth, |a, b| photometric(a, b, 0.0));
        assert_close(&format!("{name} lambda 0"), &values_of(&loss), &golden.values("l1.value"), 1e-5);
    }
}

#[test]
fn peak_signal_to_noise_ratio() {
    let golden = Golden::open("c09_losses");
    for (name, device) in devices() {
        let (image, truth) = (golden.tensor::<4>("img", &device), golden.tensor::<4>("gt", &device));
        let found: Vec<f32> =
            (0..image.dims()[0]).map(|i| psnr(image_of(&image, i), image_of(&truth, i)) as f32).collect();
        assert_close(&format!("{name} psnr.per_image"), &found, &golden.values("psnr.per_image"), 1e-3);
    }
}

#[test]
fn plane_regularizers() {
    let golden = Golden::open("c09_losses");
    let scales = (0..).find(|s| !golden.has(&format!("reg.plane.scale{s}.0"))).unwrap();
    for (name, device) in devices() {
        let device = device.autodiff();
        let keys = (0..scales).flat_map(|s| (0..6).map(move |p| format!("reg.plane.scale{s}.{p}")));
        let planes = keys.map(|key| golden.tensor::<3>(&key, &device)).collect();
        let hexplane = FeaturePlanes::from_tensors(PlaneTensors::at_scales(&PlaneAxes::ALL, planes));
        let check = |term: &str, loss: Tensor<1>| {
            let value = golden.values(&format!("reg.{term}.value"));
            assert_close(&format!("{name} {term}.value"), &values_of(&loss), &value, 1e-5);
            let grads = loss.backward();
            for (i, plane) in hexplane.planes.iter().enumerate() {
                let key = format!("reg.{term}.grad.scale{}.{}", i / 6, i % 6);
                let gradient = plane.val().grad(&grads);
                assert_eq!(gradient.is_some(), golden.has(&key), "{name} {key}");
                if let Some(gradient) = gradient {
                    assert_close_relative(&format!("{name} {key}"), &values_of(&gradient), &golden.values(&key), 1e-4);
                }
            }
        };
        let loss = |[time_smoothness, time_l1, plane_smoothness]: [f32; 3]| {
            PlaneRegularizer { time_smoothness, time_l1, plane_smoothness }.loss(&hexplane)
        };
        check("time_smooth", loss([1.0, 0.0, 0.0]));
        check("l1_time", loss([0.0, 1.0, 0.0]));
        check("plane_smooth", loss([0.0, 0.0, 1.0]));
        let weights = golden.values("reg.compute_regulation.weights_time_l1_plane");
        check("compute_regulation", loss(weights.try_into().expect("three weights")));
    }
}

/// The rows of c10 that belong to Gaussians have ranks 2 and 3. They are flattened, which makes no difference to the
/// optimizer.
struct Group {
    key: &'static str,
    /// The name under which the optimizer knows the parameter. The opacities have the name that [`reset_opacity`] uses.
    name: &'static str,
    parameter: Param<Tensor<2>>,
}

const GROUPS: [(&str, &str); 5] = [
    ("xyz", "xyz"),
    ("f_dc", "f_dc"),
    ("opacity", "gaussians.opacity_logits"),
    ("scaling", "scaling"),
    ("sparse", "sparse"),
];

fn rows_of(golden: &Golden, key: &str, device: &Device) -> Tensor<2> {
    let count = golden.shape(key)[0];
    let values = golden.values(key);
    let width = values.len() / count;
    Tensor::from_data(TensorData::new(values, [count, width]), device)
}

/// One step of several parameters with given gradients. Parameters without a gradient are left out of the loss, as when
/// an iteration does not use them.
fn step(adam: &mut Adam, groups: &mut [Group], gradients: &[Option<Tensor<2>>], rates: &[f64]) {
    let terms = groups.iter().zip(gradients).filter_map(|(group, gradient)| {
        gradient.as_ref().map(|gradient| (group.parameter.val() * gradient.clone()).sum())
    });
    let mut grads = terms.reduce(|sum, term| sum + term).unwrap().backward();
    for (group, rate) in groups.iter_mut().zip(rates) {
        if let Some(gradient) = group.parameter.val().grad_remove(&mut grads) {
            adam.step(group.name, &mut group.parameter, gradient, *rate);
        }
    }
}

/// Steps all groups of c10 to the end. Also returns the last rate of `xyz`.
fn stepped(golden: &Golden, name: &str, device: &Device) -> (Adam, Vec<Group>, f64) {
    let mut adam = Adam::default();
    let mut groups: Vec<Group> = GROUPS
        .iter()
        .map(|&(key, name)| {
            let parameter = Param::from_tensor(rows_of(golden, &format!("init.{key}"), device));
            Group { key, name, parameter }
        })
        .collect();
    let mut last_rate = 0.0;
    for t in (1..).take_while(|t| golden.has(&format!("step{t}.param.xyz"))) {
        let gradients: Vec<_> = groups
            .iter()
            .map(|group| format!("step{t}.grad.{}", group.key))
            .map(|key| golden.has(&key).then(|| rows_of(golden, &key, device)))
            .collect();
        last_rate = f64::from(golden.scalar(&format!("step{t}.lr_xyz")));
        let rates: Vec<f64> = groups
            .iter()
            .map(
                |group| if group.key == "xyz" { last_rate } else { golden.scalar(&format!("lr.{}", group.key)).into() },
            )
            .collect();
        step(&mut adam, &mut groups, &gradients, &rates);
        for group in &groups {
            let key = format!("step{t}.param.{}", group.key);
            assert_close(&format!("{name} {key}"), &values_of(&group.parameter.val()), &golden.values(&key), 1e-6);
        }
    }
    assert!(last_rate > 0.0, "the case has steps");
    (adam, groups, last_rate)
}

#[test]
fn adam() {
    let golden = Golden::open("c10_adam_lr");
    for (name, device) in devices() {
        let (adam, groups, _) = stepped(&golden, name, &device.autodiff());
        for group in &groups {
            let AdamState { first, second, time } = &adam.states[group.name];
            let key = |what: &str| format!("final.{what}.{}", group.key);
            assert_eq!(i64::from(*time), golden.integers(&key("step"))[0], "{name} {}", key("step"));
            let check = |what: &str, found: &Tensor<1>| {
                let expected = golden.values(&key(what));
                assert_close(&format!("{name} {}", key(what)), &values_of(found), &expected, 1e-6);
                // Second moments are small. In float32, 1 - 0.999 has a relative error of 1.3e-5, and so have they.
                assert_close_relative(&format!("{name} {}", key(what)), &values_of(found), &expected, 5e-5);
            };
            check("exp_avg", first);
            check("exp_avg_sq", second);
        }
    }
}

#[test]
fn adam_after_rows_came_and_went() {
    let golden = Golden::open("c10_adam_lr");
    for (name, device) in devices() {
        let device = device.autodiff();
        let (mut adam, mut groups, rate) = stepped(&golden, name, &device);
        let xyz = &mut groups[0];
        let before = xyz.parameter.dims()[0];
        let steps_before = adam.states[xyz.name].time;

        let longer = Tensor::cat(vec![xyz.parameter.val(), rows_of(&golden, "surgery.new_rows", &device)], 0);
        let kept: Vec<i64> =
            (0..).zip(golden.integers("surgery.keep_mask")).filter(|(_, k)| *k == 1).map(|(i, _)| i).collect();
        let ints = |values: &[i64], device: &Device| {
            Tensor::<1, Int>::from_data(TensorData::new(values.to_vec(), [values.len()]), device)
        };
        // New rows have no source row. Any row may be named, since its moments become zeros.
        let is_new = |row: &i64| *row >= before as i64;
        let sources: Vec<i64> = kept.iter().map(|row| if is_new(row) { 0 } else { *row }).collect();
        let fresh: Vec<f32> = kept.iter().map(|row| f32::from(is_new(row))).collect();
        let fresh = Tensor::<1>::from_floats(&fresh[..], &device.clone().inner());
        adam.select_rows(xyz.name, &ints(&sources, &device.clone().inner()), &fresh, before);
        let cut = longer.select(0, ints(&kept, &device));
        xyz.parameter = Param::from_tensor(Tensor::from_data(cut.into_data(), &device));
        let expected = golden.values("surgery.param_after_cut");
        assert_close(&format!("{name} param_after_cut"), &values_of(&xyz.parameter.val()), &expected, 1e-6);
        assert_eq!(adam.states[xyz.name].time, steps_before);

        for t in (1..).take_while(|t| golden.has(&format!("surgery.grad_xyz.{t}"))) {
            let gradient = rows_of(&golden, &format!("surgery.grad_xyz.{t}"), &device);
            step(&mut adam, &mut groups[..1], &[Some(gradient)], &[rate]);
            let key = format!("surgery.param_xyz.{t}");
            assert_close(&format!("{name} {key}"), &values_of(&groups[0].parameter.val()), &golden.values(&key), 1e-6);
        }
    }
}

#[test]
fn adam_after_an_opacity_reset() {
    let golden = Golden::open("c10_adam_lr");
    for (name, device) in devices() {
        let device = device.autodiff();
        let (mut adam, mut groups, _) = stepped(&golden, name, &device);
        let at = groups.iter().position(|group| group.key == "opacity").unwrap();
        let opacity = &mut groups[at];
        let count = opacity.parameter.dims()[0];
        let zeros = |width: usize| Tensor::<2>::zeros([count, width], &device);
        let mut gaussians = Gaussians::from_tensors(GaussianTensors {
            means: zeros(3),
            log_scales: zeros(3),
            quats: zeros(4),
            opacity_logits: Tensor::from_data(opacity.parameter.val().into_data(), &device),
            sh_dc: zeros(3).reshape([count, 1, 3]),
            sh_rest: zeros(45).reshape([count, 15, 3]),
            further: Vec::new(),
        });
        let steps_before = adam.states[opacity.name].time;
        reset_opacity(&mut GaussianEditor::new(&mut gaussians, &mut adam));
        let expected = golden.values("surgery.opacity_after_reset");
        let found = values_of(&gaussians.opacity_logits.val());
        assert_close(&format!("{name} surgery.opacity_after_reset"), &found, &expected, 1e-6);
        let state = &adam.states[opacity.name];
        assert!(values_of(&state.first).into_iter().chain(values_of(&state.second)).all(|moment| moment == 0.0));
        assert_eq!(state.time, steps_before);

        opacity.parameter = gaussians.opacity_logits;
        for t in (1..).take_while(|t| golden.has(&format!("surgery.grad_opacity.{t}"))) {
            let gradient = rows_of(&golden, &format!("surgery.grad_opacity.{t}"), &device);
            let rate = golden.scalar("lr.opacity").into();
            step(&mut adam, &mut groups[at..at + 1], &[Some(gradient)], &[rate]);
            let key = format!("surgery.param_opacity.{t}");
            assert_close(&format!("{name} {key}"), &values_of(&groups[at].parameter.val()), &golden.values(&key), 1e-6);
        }
    }
}

#[test]
fn learning_rates() {
    let golden = Golden::open("c10_adam_lr");
    let steps = golden.integers("lr_table.steps");
    let configs = golden.values("lr_table.configs_init_final_delaysteps_delaymult_max");
    let rates = golden.values("lr_table.lr");
    for (config, expected) in configs.chunks_exact(5).zip(rates.chunks_exact(steps.len())) {
        let [initial, last, delay_steps, delay_factor, length] = std::array::from_fn(|k| f64::from(config[k]));
        let decay = ExponentialDecay { initial, last, delay_steps, delay_factor, steps: length };
        let found: Vec<f32> = steps.iter().map(|step| decay.at(*step as f64) as f32).collect();
        assert_close(&format!("{config:?}"), &found, expected, 1e-6);
        for (found, expected) in found.iter().zip(expected) {
            // The rates themselves are near 1e-6, so the relative comparison is the strict one.
            assert!((found - expected).abs() <= 1e-5 * expected, "{config:?}: {found:e} against {expected:e}");
        }
    }
}

fn matrix(golden: &Golden, key: &str, device: &Device) -> Tensor<2> {
    rows_of(golden, key, device)
}

/// Gaussians stored under a prefix.
fn gaussians_of(golden: &Golden, prefix: &str, device: &Device) -> Gaussians {
    let tensor = |key: &str| matrix(golden, &format!("{prefix}.{key}"), device);
    Gaussians::from_tensors(GaussianTensors {
        means: tensor("xyz"),
        log_scales: tensor("scaling_log"),
        quats: tensor("rotation"),
        opacity_logits: tensor("opacity_logit"),
        sh_dc: golden.tensor(&format!("{prefix}.f_dc"), device),
        sh_rest: golden.tensor(&format!("{prefix}.f_rest"), device),
        further: Vec::new(),
    })
}

fn booleans(golden: &Golden, key: &str) -> Vec<bool> {
    golden.integers(key).into_iter().map(|v| v != 0).collect()
}

fn density_masks(golden: &Golden, name: &str, gaussians: &Gaussians, device: &Device) -> DensifyMasks {
    let vector = |key: &str| matrix(golden, key, device).squeeze_dim::<1>(1);
    let mut statistics = DensityStatistics::new(gaussians.len(), device);
    statistics.gradient_sum = vector("in.grad_accum");
    statistics.views = vector("in.denom");
    let mean_gradients = statistics.mean_gradients();
    assert_close_relative(&format!("{name} avg_grad"), &mean_gradients, &golden.values("avg_grad"), 1e-5);
    let size = golden.scalar("in.percent_dense") * golden.scalar("in.extent");
    DensifyMasks::new(&mean_gradients, &largest_scales(gaussians), golden.scalar("in.grad_threshold"), size)
}

#[test]
fn densification() {
    let golden = Golden::open("c11_densify");
    for (name, device) in devices() {
        let device = device.autodiff();
        let inner = device.clone().inner();
        let mut gaussians = gaussians_of(&golden, "in", &device);
        let count = gaussians.len();
        let masks = density_masks(&golden, name, &gaussians, &inner);
        assert_eq!(masks.clone, booleans(&golden, "clone_mask"), "{name} clone_mask");
        assert_eq!(masks.split, booleans(&golden, "split_mask"), "{name} split_mask");
        // The file has more normals than there are halves.
        let normals = golden.values("in.unit_normals")[..masks.normals_needed()].to_vec();

        // The file has only the moments after the step. Rows that stay tell what their moments were before. Rows that
        // are split had some as well, which must not survive.
        let sources: Vec<usize> = golden.integers("after_densify.source_index").iter().map(|i| *i as usize).collect();
        let after = golden.values("after_densify.exp_avg_xyz");
        let mut moments = vec![7.0; 3 * count];
        let kept = masks.split.iter().filter(|split| !**split).count();
        for (row, &source) in sources.iter().enumerate().take(kept) {
            moments[3 * source..3 * source + 3].copy_from_slice(&after[3 * row..3 * row + 3]);
        }
        let first = Tensor::<1>::from_floats(&moments[..], &inner);
        let mut adam = Adam::default();
        let state = AdamState { second: first.clone(), first, time: 9 };
        adam.states.insert("gaussians.means".to_owned(), state);

        let rows = densify(&mut GaussianEditor::new(&mut gaussians, &mut adam), &masks, &normals);
        assert_eq!(rows, sources, "{name} source_index");
        let check = |key: &str, found: Vec<f32>| {
            let key = format!("after_densify.{key}");
            assert_close(&format!("{name} {key}"), &found, &golden.values(&key), 1e-5);
        };
        let GaussianTensors { means, log_scales, quats, opacity_logits, sh_dc, sh_rest, .. } = gaussians.tensors();
        assert!(means.is_require_grad(), "the result is trained further");
        check("xyz", values_of(&means));
        check("scaling_log", values_of(&log_scales));
        check("rotation", values_of(&quats));
        check("opacity_logit", values_of(&opacity_logits));
        check("f_dc", values_of(&sh_dc));
        check("f_rest", values_of(&sh_rest));
        let AdamState { first, second, time } = &adam.states["gaussians.means"];
        check("exp_avg_xyz", values_of(first));
        check("exp_avg_xyz", values_of(second));
        assert_eq!(*time, 9);
        let fresh = DensityStatistics::new(gaussians.len(), &inner);
        check("grad_accum_after", values_of(&fresh.gradient_sum));
        check("denom_after", values_of(&fresh.views));
        check("max_radii_after", values_of(&fresh.largest_radius));
    }
}

/// Moments whose values tell the row that they belong to.
fn numbered_moments(gaussians: &Gaussians, device: &Device) -> Adam {
    let values: Vec<f32> = (0..gaussians.len()).map(|row| row as f32).collect();
    let first = Tensor::<1>::from_floats(&values[..], device);
    let mut adam = Adam::default();
    let state = AdamState { second: first.clone(), first, time: 3 };
    adam.states.insert("gaussians.opacity_logits".to_owned(), state);
    adam
}

#[test]
fn pruning() {
    let golden = Golden::open("c11_densify");
    for (name, device) in devices() {
        let device = device.autodiff();
        let inner = device.clone().inner();
        let size_limit = SizeLimit {
            max_radius: golden.scalar("prune_with_size.max_screen_size"),
            max_scale: 0.1 * golden.scalar("in.extent"),
        };
        for (case, limit) in [("prune_no_size", None), ("prune_with_size", Some(size_limit))] {
            let mut gaussians = gaussians_of(&golden, "after_densify", &device);
            let radii_key = "prune_with_size.max_radii2D";
            let radii = Tensor::<1>::from_floats(&golden.values(radii_key)[..], &inner);
            let keep = survivors(&gaussians, golden.scalar(&format!("{case}.min_opacity")), limit, &radii);
            let dropped: Vec<bool> = keep.iter().map(|keep| !keep).collect();
            assert_eq!(dropped, booleans(&golden, &format!("{case}.mask")), "{name} {case}");

            let means = values_of(&gaussians.means.val());
            let mut adam = numbered_moments(&gaussians, &inner);
            GaussianEditor::new(&mut gaussians, &mut adam).keep(&keep);
            assert_eq!(gaussians.len() as i64, golden.integers(&format!("{case}.n_after"))[0], "{name} {case}");
            let left: Vec<usize> = (0..keep.len()).filter(|i| keep[*i]).collect();
            let expected: Vec<f32> = left.iter().flat_map(|i| means[3 * i..3 * i + 3].to_vec()).collect();
            assert_eq!(values_of(&gaussians.means.val()), expected, "{name} {case}");
            let numbers: Vec<f32> = left.iter().map(|i| *i as f32).collect();
            assert_eq!(values_of(&adam.states["gaussians.opacity_logits"].first), numbers, "{name} {case}");
            assert_eq!(values_of(&adam.states["gaussians.opacity_logits"].second), numbers, "{name} {case}");
        }
    }
}

#[test]
fn opacity_reset() {
    let golden = Golden::open("c11_densify");
    for (name, device) in devices() {
        let device = device.autodiff();
        let mut gaussians = gaussians_of(&golden, "after_densify", &device);
        let mut adam = numbered_moments(&gaussians, &device.clone().inner());
        reset_opacity(&mut GaussianEditor::new(&mut gaussians, &mut adam));
        let found = values_of(&gaussians.opacity_logits.val());
        assert_close(&format!("{name} reset_opacity.logit"), &found, &golden.values("reset_opacity.logit"), 1e-5);
    }
}

#[test]
fn initial_gaussians() {
    let golden = Golden::open("c11_densify");
    let positions: Vec<[f32; 3]> = golden.values("init.points").as_chunks().0.to_vec();
    let cloud = PointCloud { colors: vec![[0.5; 3]; positions.len()], positions };
    // The file has the distances before the clamp at 1e-7.
    let distances: Vec<f32> = golden.values("init.mean_dist2").iter().map(|d| d.max(1e-7)).collect();
    assert_close("init.mean_dist2", &cloud.mean_squared_distances(), &distances, 1e-5);
    for (name, device) in devices() {
        let gaussians = GaussiansConfig::new().init(&cloud, &device);
        let log_scales = values_of(&gaussians.log_scales.val());
        assert_close(&format!("{name} init.scaling_log"), &log_scales, &golden.values("init.scaling_log"), 1e-5);
        let logits = values_of(&gaussians.opacity_logits.val());
        let expected = vec![golden.scalar("init.opacity_logit"); cloud.len()];
        assert_close(&format!("{name} init.opacity_logit"), &logits, &expected, 1e-5);
    }
}
