//! The query of sets of planes other than the hexplane, against a hexplane whose other planes are filled with ones:
//! values and gradients.

use burn::tensor::{Device, Distribution, Tensor};
use light4gs_codec::plane_layout::{PlaneAxes, PlaneLayout};
use light4gs_model::{FeaturePlanes, PlaneTensors, regularizer::PlaneRegularizer};
use light4gs_tests::golden::{assert_close, devices, values_of};
use light4gs_tests::planes::plane_sets;

/// Not a whole number of blocks of eight.
const CHANNELS: usize = 11;
const POINTS: usize = 300;

/// Planes on a tape.
fn random_planes(layout: &PlaneLayout, device: &Device) -> PlaneTensors {
    let shapes = layout.planes().iter().map(|plane| [CHANNELS, plane.size[0], plane.size[1]]);
    let planes = shapes.map(|shape| Tensor::random(shape, Distribution::Uniform(0.4, 1.4), device).require_grad());
    PlaneTensors::new(layout.clone(), planes.collect())
}

/// For each scale of planes a product of single hexplanes: one hexplane for each plane, with ones in all its other
/// planes.
fn expected(planes: &PlaneTensors, points: &Tensor<2>) -> Tensor<2> {
    let scale = |scale: usize| {
        let single = planes.layout().scale(scale).map(|place| {
            let ([across, down], [height, width]) = {
                let shape = planes.layout().planes()[place];
                (shape.axes.axes(), shape.size)
            };
            let mut resolution = [2; 4];
            (resolution[across], resolution[down]) = (width, height);
            let hexplane = PlaneLayout::multiscale(&PlaneAxes::ALL, resolution, &[1]);
            let all = hexplane.planes().iter().map(|plane| match plane.axes == planes.layout().planes()[place].axes {
                true => planes[place].clone(),
                false => Tensor::ones([CHANNELS, plane.size[0], plane.size[1]], &points.device()),
            });
            let all = all.collect();
            PlaneTensors::new(hexplane, all).query(points.clone())
        });
        single.reduce(|product, feature| product * feature).expect("a scale has a plane")
    };
    Tensor::cat((0..planes.layout().scales()).map(scale).collect(), 1)
}

#[test]
fn features_and_gradients_of_any_set_of_planes() {
    for (name, device) in devices() {
        let device = device.autodiff();
        device.seed(4);
        for (set, layout) in plane_sets() {
            let what = |part: &str| format!("{name}, {set}: {part}");
            let planes = random_planes(&layout, &device);
            // Some points are outside.
            let points = Tensor::<2>::random([POINTS, 4], Distribution::Uniform(-1.1, 1.1), &device).require_grad();
            let weights = Tensor::random([POINTS, CHANNELS * layout.scales()], Distribution::Default, &device);
            let results = [planes.query(points.clone()), expected(&planes, &points)].map(|features| {
                let gradients = (features.clone() * weights.clone()).sum().backward();
                let of_planes = planes.iter().map(|plane| values_of(&plane.grad(&gradients).unwrap()));
                (values_of(&features), values_of(&points.grad(&gradients).unwrap()), of_planes.collect::<Vec<_>>())
            });
            let [(features, of_points, of_planes), expected] = results;
            assert_close(&what("features"), &features, &expected.0, 1e-4);
            assert_close(&what("gradients of points"), &of_points, &expected.1, 1e-3);
            for (place, (found, expected)) in of_planes.iter().zip(&expected.2).enumerate() {
                assert_close(&what(&format!("gradients of plane {place}")), found, expected, 1e-3);
            }
        }
    }
}

/// The gradient of positions goes through the planes without time, whichever other planes there are.
#[test]
fn features_over_space_leave_time_out() {
    for (name, device) in devices() {
        let device = device.autodiff();
        device.seed(4);
        for (set, layout) in plane_sets() {
            let planes = random_planes(&layout, &device);
            let still = planes.map(|place, plane| match layout.planes()[place].axes.is_space_time() {
                true => Tensor::ones(plane.dims(), &device),
                false => plane,
            });
            let positions = Tensor::<2>::random([POINTS, 3], Distribution::Uniform(-1.1, 1.1), &device);
            let points = Tensor::cat(vec![positions.clone(), Tensor::zeros([POINTS, 1], &device)], 1);
            let (found, expected) = (planes.query_space(positions), still.query(points));
            assert_close(&format!("{name}, {set}"), &values_of(&found), &values_of(&expected), 1e-5);
        }
    }
}

/// In a set of planes of one kind, the terms of the other kind are 0.
#[test]
fn regularizers_by_axes() {
    let device = Device::flex().autodiff();
    device.seed(4);
    for (set, layout) in plane_sets() {
        let planes = FeaturePlanes::from_tensors(random_planes(&layout, &device));
        let has = |space_time: bool| layout.planes().iter().any(|plane| plane.axes.is_space_time() == space_time);
        let loss = |[plane_smoothness, time_smoothness, time_l1]: [f32; 3]| {
            PlaneRegularizer { plane_smoothness, time_smoothness, time_l1 }.loss(&planes)
        };
        let terms: [(&str, Tensor<1>, bool); 3] = [
            ("over space", loss([1.0, 0.0, 0.0]), has(false)),
            ("over time", loss([0.0, 1.0, 0.0]), has(true)),
            ("from 1", loss([0.0, 0.0, 1.0]), has(true)),
        ];
        for (term, value, there) in terms {
            assert_eq!(values_of(&value)[0] > 0.0, there, "{set}: {term}");
        }
    }
}
