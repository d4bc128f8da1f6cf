//! Weights of LPIPS, in the layouts in which they are published.
//!
//! The `lpips` package ships the heads alone (`lin0.model.1.weight`...), torchvision the network (`features.0.weight`...); a
//! saved `lpips.LPIPS` has both (`net.slice1.0.weight`...), and so have files with plain names (`conv0.weight`,
//! `lin0.weight`...). Shapes tell the networks apart.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use burn::module::Param;
use burn::nn::PaddingConfig2d;
use burn::nn::conv::Conv2d;
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_data::{DataError, PlainTensor, read_pytorch};
use safetensors::{Dtype, SafeTensors};

use super::network::LayerShape;
use super::{Lpips, LpipsNetwork};

const REMEDY: &str = "see docs/metrics.md for where the weights are published";

/// A file's tensors.
struct WeightFile {
    path: PathBuf,
    tensors: BTreeMap<String, PlainTensor>,
}

/// The networks whose parts the files contain.
pub(super) fn load(files: &[PathBuf], device: &Device) -> Result<Vec<Lpips>, DataError> {
    let files = files.iter().map(|path| WeightFile::read(path)).collect::<Result<Vec<_>, _>>()?;
    for file in &files {
        if LpipsNetwork::ALL.into_iter().all(|network| !file.has_network(network) && !file.has_heads(network)) {
            let names: Vec<&str> = file.tensors.keys().take(4).map(String::as_str).collect();
            let problem =
                format!("neither convolutions nor heads of AlexNet or VGG-16 (it has {}, ...)", names.join(", "));
            return Err(DataError::field(&file.path, "tensors", problem, REMEDY));
        }
    }
    let mut found = Vec::new();
    for network in LpipsNetwork::ALL {
        let convolutions = files.iter().find(|file| file.has_network(network));
        let heads = files.iter().find(|file| file.has_heads(network));
        match (convolutions, heads) {
            (Some(convolutions), Some(heads)) => found.push(assemble(network, convolutions, heads, device)?),
            (Some(lonely), None) => return Err(lonely.lacks(network, "heads (`lin0`...`lin4`)")),
            (None, Some(lonely)) => return Err(lonely.lacks(network, "convolutions (torchvision's `features`)")),
            (None, None) => {}
        }
    }
    Ok(found)
}

impl WeightFile {
    fn read(path: &Path) -> Result<Self, DataError> {
        let is_safetensors = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("safetensors"));
        let tensors = if is_safetensors { read_safetensors(path)? } else { read_pytorch(path)? };
        Ok(Self { path: path.to_owned(), tensors })
    }

    fn lacks(&self, network: LpipsNetwork, what: &str) -> DataError {
        let problem = format!("it belongs to {network}, whose {what} are in none of the files named");
        DataError::field(&self.path, "tensors", problem, "name the file that has them too")
    }

    /// The first of the names that exists.
    fn find(&self, names: &[String]) -> Option<(&str, &PlainTensor)> {
        names.iter().find_map(|name| self.tensors.get_key_value(name)).map(|(name, tensor)| (name.as_str(), tensor))
    }

    fn has_network(&self, network: LpipsNetwork) -> bool {
        let first = &network.layers()[0];
        let shape = [first.outputs, first.inputs, first.kernel, first.kernel];
        self.find(&convolution_names(0, first, "weight")).is_some_and(|(_, tensor)| tensor.shape == shape)
    }

    /// The networks are told apart by the second tap, the first one at which they have different channels.
    fn has_heads(&self, network: LpipsNetwork) -> bool {
        let channels = network.tap_channels().nth(1);
        self.find(&head_names(1)).is_some_and(|(_, tensor)| Some(tensor.values.len()) == channels)
    }

    /// A tensor of the given shape. Errors name the first of the names.
    fn take(&self, names: &[String], shape: &[usize]) -> Result<Vec<f32>, DataError> {
        let wrong = |field: &str, problem: String| {
            let known = names.join("`, `");
            DataError::field(&self.path, field, format!("{problem} (known names: `{known}`)"), REMEDY)
        };
        let (name, tensor) = self.find(names).ok_or_else(|| wrong(&names[0], "it is missing".into()))?;
        if tensor.shape != shape {
            return Err(wrong(name, format!("shape {:?}, expected {shape:?}", tensor.shape)));
        }
        if tensor.values.iter().any(|value| !value.is_finite()) {
            return Err(wrong(name, "it holds NaN or infinity".into()));
        }
        Ok(tensor.values.clone())
    }
}

fn read_safetensors(path: &Path) -> Result<BTreeMap<String, PlainTensor>, DataError> {
    let bytes = light4gs_data::read_regular_file(path, u64::MAX).map_err(DataError::io("read", path))?;
    let remedy = "copy or download it again";
    let file = SafeTensors::deserialize(&bytes)
        .map_err(|error| DataError::field(path, "SafeTensors header", error.to_string(), remedy))?;
    let mut tensors = BTreeMap::new();
    for (name, view) in file.tensors() {
        if view.dtype() != Dtype::F32 {
            return Err(DataError::field(path, name, format!("type {:?}, expected F32", view.dtype()), "convert it"));
        }
        let values = view.data().as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        tensors.insert(name, PlainTensor { shape: view.shape().to_vec(), values });
    }
    Ok(tensors)
}

/// Names of convolution `number`.
fn convolution_names(number: usize, layer: &LayerShape, part: &str) -> Vec<String> {
    let slices = (1..=5).map(|slice| format!("net.slice{slice}.{}.{part}", layer.index));
    [format!("conv{number}.{part}"), format!("features.{}.{part}", layer.index)].into_iter().chain(slices).collect()
}

/// Names of the weights of a tap's channels. In the package they may follow a dropout layer.
fn head_names(tap: usize) -> Vec<String> {
    [format!("lin{tap}.weight"), format!("lin{tap}.model.1.weight"), format!("lin{tap}.model.0.weight")].into()
}

fn assemble(
    network: LpipsNetwork,
    convolutions: &WeightFile,
    heads: &WeightFile,
    device: &Device,
) -> Result<Lpips, DataError> {
    let constant = |values: Vec<f32>, shape: [usize; 4]| {
        Param::from_tensor(Tensor::<4>::from_data(TensorData::new(values, shape), device)).set_require_grad(false)
    };
    let convolution = |(number, layer): (usize, &LayerShape)| {
        let shape = [layer.outputs, layer.inputs, layer.kernel, layer.kernel];
        let weight = convolutions.take(&convolution_names(number, layer, "weight"), &shape)?;
        let bias = convolutions.take(&convolution_names(number, layer, "bias"), &[layer.outputs])?;
        let bias = Tensor::<1>::from_data(TensorData::new(bias, [layer.outputs]), device);
        let LayerShape { stride, kernel, padding, .. } = *layer;
        Ok::<_, DataError>(Conv2d {
            weight: constant(weight, shape),
            bias: Some(Param::from_tensor(bias).set_require_grad(false)),
            stride: [stride; 2],
            kernel_size: [kernel; 2],
            dilation: [1; 2],
            groups: 1,
            padding: PaddingConfig2d::Explicit(padding, padding, padding, padding),
        })
    };
    let head = |(tap, channels): (usize, usize)| {
        let shape = [1, channels, 1, 1];
        Ok::<_, DataError>(constant(heads.take(&head_names(tap), &shape)?, shape))
    };
    Ok(Lpips {
        convolutions: network.layers().iter().enumerate().map(convolution).collect::<Result<_, _>>()?,
        heads: network.tap_channels().enumerate().map(head).collect::<Result<_, _>>()?,
        network,
    })
}
