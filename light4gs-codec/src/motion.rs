//! Where the Gaussians are at a time: the hexplane's features through the deformation network, on plain arrays.

use crate::{
    CodecError, LinearLayer, SceneData,
    query::{multiply_by_sample, normalised},
    sections::{SectionKind, hexplanes::AXES},
};

const SECTION: &str = SectionKind::Deformation.name();

impl SceneData {
    /// The centres of the Gaussians at a `time` in [0, 1], in world units: the canonical ones where nothing moves.
    ///
    /// For tools that want to look into a file without a back end. It follows the model's conventions (DESIGN section
    /// 3) to float tolerance, takes some microseconds a Gaussian, and uses one thread.
    ///
    /// # Errors
    /// A deformation network without the layers that its heads ask for, or with other sizes.
    pub fn positions_at(&self, time: f32) -> Result<Vec<[f32; 3]>, CodecError> {
        if !self.deformation.heads.position || self.hexplane.planes.is_empty() {
            return Ok(self.gaussians.means.clone());
        }
        let network = PositionNetwork::of(self)?;
        let moved = |&mean: &[f32; 3]| {
            let [dx, dy, dz] = network.shift(self.features(mean, time));
            [mean[0] + dx, mean[1] + dy, mean[2] + dz]
        };
        Ok(self.gaussians.means.iter().map(moved).collect())
    }

    /// Products of the six samples of each scale, `[channels · scales]`.
    fn features(&self, point: [f32; 3], time: f32) -> Vec<f32> {
        let [x, y, z] = normalised(&self.frame, point);
        let coordinates = [x, y, z, 2.0 * time - 1.0];
        let channels = self.hexplane.channels as usize;
        let mut features = vec![1.0; channels * self.hexplane.multipliers.len()];
        for (product, planes) in features.chunks_exact_mut(channels).zip(self.hexplane.planes.chunks_exact(6)) {
            for (plane, (across, down)) in planes.iter().zip(AXES) {
                multiply_by_sample(plane, coordinates[across], coordinates[down], product);
            }
        }
        features
    }
}

/// The trunk and the position head, ReLU between all layers.
struct PositionNetwork<'a> {
    layers: Vec<&'a LinearLayer>,
}

impl<'a> PositionNetwork<'a> {
    fn of(scene: &'a SceneData) -> Result<Self, CodecError> {
        let network = &scene.deformation;
        let trunk = (0..network.depth.max(1)).map(|i| format!("trunk.{i}"));
        let names = trunk.chain(["position.hidden".into(), "position.output".into()]);
        let mut inputs = scene.hexplane.channels * scene.hexplane.multipliers.len() as u32;
        let mut layers = Vec::new();
        for name in names {
            let Some(layer) = network.layers.iter().find(|layer| layer.name == name) else {
                return Err(CodecError::invalid(SECTION, "layers", format!("without {name}"), "one of that name"));
            };
            if layer.inputs != inputs {
                return Err(CodecError::invalid(SECTION, format!("{name}.inputs"), layer.inputs, inputs.to_string()));
            }
            inputs = layer.outputs;
            layers.push(layer);
        }
        if inputs != 3 {
            return Err(CodecError::invalid(SECTION, "position.output.outputs", inputs, "3"));
        }
        Ok(Self { layers })
    }

    fn shift(&self, features: Vec<f32>) -> [f32; 3] {
        let mut values = features;
        for (index, layer) in self.layers.iter().enumerate() {
            if index > 0 {
                values.iter_mut().for_each(|value| *value = value.max(0.0));
            }
            let rows = layer.weight.chunks_exact(values.len()).zip(&layer.bias);
            values = rows.map(|(row, &bias)| row.iter().zip(&values).fold(bias, |sum, (w, x)| sum + w * x)).collect();
        }
        [values[0], values[1], values[2]]
    }
}
