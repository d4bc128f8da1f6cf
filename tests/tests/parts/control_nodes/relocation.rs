//! Nodes that move while training.

use burn::module::Param;
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_model::SceneAtRest;
use light4gs_model::parameters::{ParameterMapper, ParameterVisitor, map_parameters, visit_parameters};
use light4gs_model::{DeformationField, DynamicScene, FinePosition, NodesField, NodesFieldConfig, PositionGradients};
use light4gs_tests::golden::values_of;

use super::{EXTENT, POSITION, many};

const NODES: usize = 12;

/// The nodes' anchors, world units.
struct Anchors(Vec<[f32; 3]>);

impl ParameterVisitor for Anchors {
    fn visit<const D: usize>(&mut self, path: &str, parameter: &Param<Tensor<D>>) {
        if path.ends_with("anchors") {
            let anchors = values_of(&parameter.val());
            self.0 = anchors.as_chunks::<3>().0.iter().map(|anchor| anchor.map(|part| part * EXTENT)).collect();
        }
    }
}

fn anchors(scene: &DynamicScene<NodesField>) -> Vec<[f32; 3]> {
    let mut anchors = Anchors(Vec::new());
    visit_parameters(&scene.field, &mut anchors);
    anchors.0
}

/// All nodes together turn the world by a right angle about z, at all times; one lifts what is near it besides.
struct Turned {
    anchors: Vec<[f32; 3]>,
    lifting: usize,
}

impl ParameterMapper for Turned {
    fn map<const D: usize>(&mut self, path: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let half = 0.5_f32.sqrt();
        let row: Vec<f32> = match path.rsplit('.').next() {
            Some("rotations") => self.anchors.iter().flat_map(|_| [half - 1.0, 0.0, 0.0, half]).collect(),
            Some("translations") => {
                let lift = |node: usize| if node == self.lifting { 0.2 } else { 0.0 };
                let nodes = self.anchors.iter().enumerate();
                nodes.flat_map(|(node, [x, y, _])| [(-y - x) / EXTENT, (x - y) / EXTENT, lift(node)]).collect()
            }
            _ => return parameter,
        };
        let knots = row.repeat(parameter.dims()[0]);
        let value = Tensor::from_data(TensorData::new(knots, parameter.dims()), &parameter.device());
        Param::initialized(parameter.id, value.require_grad())
    }
}

fn distance(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f32>().sqrt()
}

/// Nodes that matter little move to Gaussians that the loss pulls away from their neighbors, and nothing jumps.
#[test]
fn nodes_move_to_where_motion_is_not_explained() {
    let device = Device::flex().autodiff();
    let config = NodesFieldConfig::new().with_nodes(NODES).with_stillness(None).with_opacity(0.05);
    let config = config.with_relocation_interval(10).with_relocation_share(0.1);
    let scene = many(600, config, &device);
    let old = anchors(&scene);
    let means = values_of(&scene.gaussians.means.val());
    let means = means.as_chunks::<3>().0;
    let place = means[17];
    let far = |node: &usize| distance(&old[*node], &place);
    let lifting = (0..NODES).max_by(|a, b| far(a).total_cmp(&far(b))).unwrap();
    let mut scene = map_parameters(scene, &mut Turned { anchors: old.clone(), lifting });
    let pulled = means.iter().flat_map(|mean| [0.0, 0.0, f32::from(u8::from(distance(mean, &place) < 0.4))]).collect();
    let gradients = Tensor::<2>::from_data(TensorData::new(pulled, [means.len(), 3]), &device.clone().inner());
    let views = [0.9, 0.1, 0.5, 0.3, 0.7].map(|time| PositionGradients { time, gradients: gradients.clone() * time });

    let before = [0.1, 0.7].map(|time| scene.at(time));
    let DynamicScene { gaussians, coordinates, field, .. } = &mut scene;
    let at_rest = SceneAtRest { gaussians, coordinates, extent: EXTENT };
    let views_at = |iteration| field.refinement_views(&FinePosition { iteration, ..POSITION });
    assert_eq!([0, 10, 15, 60, 70].map(views_at), [0, 16, 0, 16, 0]);
    let renewed = field.refine(&at_rest, &views, &FinePosition { iteration: 20, ..POSITION });

    let new = anchors(&scene);
    let moved: Vec<usize> = (0..NODES).filter(|node| new[*node] != old[*node]).collect();
    assert!(moved.len() == 2 && !moved.contains(&lifting), "{moved:?}, lifting {lifting}");
    assert!(moved.iter().any(|node| distance(&new[*node], &place) < 0.4), "{place:?}: {new:?}");
    let numbers: Vec<(&str, usize)> = renewed.iter().map(|part| (part.path, part.elements.len())).collect();
    let knots = scene.field.knots();
    let expected = [("anchors", 6), ("log_radii", 2), ("translations", 6 * knots), ("rotations", 8 * knots)];
    assert_eq!(numbers, expected);
    let mut nodes: Vec<usize> = renewed[1].elements.clone();
    nodes.sort_unstable();
    assert_eq!(nodes, moved);
    let width = 3 * NODES;
    assert!(renewed[2].elements.iter().all(|element| moved.contains(&(element % width / 3))));

    for (time, before) in [0.1, 0.7].into_iter().zip(before) {
        let (before, after) = (values_of(&before.means), values_of(&scene.at(time).means));
        let pairs = before.as_chunks::<3>().0.iter().zip(after.as_chunks::<3>().0);
        let jumps = pairs.filter(|(before, after)| distance(before, after) > 0.02).count();
        assert!(jumps < means.len() / 10, "{jumps} Gaussians jump");
    }
}
