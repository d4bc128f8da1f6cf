//! Every float parameter of a Burn module with its dotted path: for optimizers, checkpoints, learning-rate groups and tests.
//!
//! Burn's [`ModuleVisitor`] and [`ModuleMapper`] visit a module and report each name on the way; this joins the names
//! to a path. A path consists of the names of fields and the indices of lists, as in `gaussians.means` or
//! `field.hexplane.planes.3`. Options and enums add nothing to it.
//!
//! **Order.** Depth first, fields in the order of their declaration, lists by index. It is the same for all modules of
//! the same structure.
//!
//! ```
//! use burn::module::Param;
//! use burn::tensor::{Device, Tensor};
//! use light4gs_model::HexPlaneConfig;
//! use light4gs_model::parameters::{ParameterVisitor, visit_parameters};
//!
//! #[derive(Default)]
//! struct Count(Vec<(String, usize)>);
//!
//! impl ParameterVisitor for Count {
//!     fn visit<const D: usize>(&mut self, path: &str, parameter: &Param<Tensor<D>>) {
//!         self.0.push((path.to_owned(), parameter.val().shape().num_elements()));
//!     }
//! }
//!
//! let config = HexPlaneConfig { channels: 4, resolution: [8, 8, 8, 4], ..HexPlaneConfig::default() };
//! let hexplane = config.init(&Device::flex());
//! let mut count = Count::default();
//! visit_parameters(&hexplane, &mut count);
//! assert_eq!(count.0[2], ("planes.2".to_owned(), 4 * 4 * 8));
//! ```

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::Tensor;

/// A function of every float parameter, whatever its rank; a closure could not be generic.
pub trait ParameterVisitor {
    /// Called once for each parameter.
    fn visit<const D: usize>(&mut self, path: &str, parameter: &Param<Tensor<D>>);
}

/// A function that replaces every float parameter, whatever its rank.
pub trait ParameterMapper {
    /// Called once for each parameter; the result replaces it. Keep the identity if an optimizer or a tape knows the
    /// parameter: `Param::initialized(parameter.id, value)`.
    fn map<const D: usize>(&mut self, path: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>>;
}

/// Calls the visitor with every float parameter.
pub fn visit_parameters<M: Module>(module: &M, visitor: &mut impl ParameterVisitor) {
    module.visit(&mut WithPath { path: Path::default(), inner: visitor });
}

/// The module with every float parameter replaced by the mapper's result.
pub fn map_parameters<M: Module>(module: M, mapper: &mut impl ParameterMapper) -> M {
    module.map(&mut WithPath { path: Path::default(), inner: mapper })
}

/// [`map_parameters`] for a module that cannot be moved. The mapper gets the only handle to each tensor, so that it can
/// work in place.
pub fn update_parameters<M: Module>(module: &mut M, mapper: &mut impl ParameterMapper) {
    let empty = map_parameters(module.clone(), &mut Emptied);
    let full = std::mem::replace(module, empty);
    *module = map_parameters(full, mapper);
}

/// The module on a new tape: parameters of the same values and identities, without a history.
///
/// Burn's [`Module::fork`] does this as well, but first moves each tensor to the device. The tape of the old parameter
/// records that, even where nothing moves, and keeps it for as long as the parameter lives. Every backward pass looks
/// through all records. So copies of a module that is not updated would make each other slower.
pub fn on_a_new_tape<M: Module>(module: M) -> M {
    map_parameters(module, &mut NewTape)
}

struct NewTape;

impl ParameterMapper for NewTape {
    fn map<const D: usize>(&mut self, _: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let learns = parameter.is_require_grad();
        let (id, value) = (parameter.id, parameter.into_value());
        let value = if value.device().is_autodiff() { Tensor::from_inner(value.inner()) } else { value };
        Param::initialized(id, value.set_require_grad(learns))
    }
}

struct Emptied;

impl ParameterMapper for Emptied {
    fn map<const D: usize>(&mut self, _: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let device = parameter.lazy_device();
        Param::initialized(parameter.id, Tensor::empty([0; D], &device))
    }
}

/// The position in a module while it is visited.
#[derive(Default)]
struct Path {
    /// The path so far: `names` joined by dots.
    joined: String,
    /// Lengths of `joined` before each name was added.
    lengths: Vec<usize>,
}

impl Path {
    fn enter(&mut self, name: &str, container: &str) {
        self.lengths.push(self.joined.len());
        if container.starts_with("Enum") {
            return;
        }
        if !self.joined.is_empty() {
            self.joined.push('.');
        }
        self.joined.push_str(name);
    }

    fn exit(&mut self) {
        let length = self.lengths.pop().expect("a module is left as often as it is entered");
        self.joined.truncate(length);
    }
}

struct WithPath<'a, T> {
    path: Path,
    inner: &'a mut T,
}

impl<T: ParameterVisitor> ModuleVisitor for WithPath<'_, T> {
    fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
        self.inner.visit(&self.path.joined, parameter);
    }

    fn enter_module(&mut self, name: &str, container: &str) {
        self.path.enter(name, container);
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.exit();
    }
}

impl<T: ParameterMapper> ModuleMapper for WithPath<'_, T> {
    fn map_float<const D: usize>(&mut self, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        self.inner.map(&self.path.joined, parameter)
    }

    fn enter_module(&mut self, name: &str, container: &str) {
        self.path.enter(name, container);
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.exit();
    }
}

#[cfg(all(test, feature = "flex"))]
mod tests {
    use std::time::{Duration, Instant};

    use burn::tensor::Device;

    use super::*;
    use crate::HexPlaneConfig;

    /// Copies of a module that nothing updates, as of a field in the coarse stage, do not make later ones slower.
    #[test]
    fn tapes_do_not_remember_earlier_copies() {
        const ROUND: usize = 200;
        let device = Device::flex().autodiff();
        let module = HexPlaneConfig { channels: 1, resolution: [4; 4], ..Default::default() }.init(&device);
        let round = || {
            let begin = Instant::now();
            for _ in 0..ROUND {
                let copy = on_a_new_tape(module.clone());
                let first = copy.planes[0].val();
                assert_eq!((copy.planes[0].id, first.is_require_grad()), (module.planes[0].id, true));
                let gradients = first.clone().sum().backward();
                assert!(first.grad(&gradients).is_some());
            }
            begin.elapsed()
        };
        // Every backward pass looks through all tapes there are, those of other tests too: the quickest round counts.
        let [early, late] = [(); 2].map(|()| (0..5).map(|_| round()).min().expect("rounds"));
        assert!(late < 4 * early + Duration::from_millis(50), "{ROUND} passes took {early:?}, later {late:?}");
    }
}
