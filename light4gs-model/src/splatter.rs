//! Differentiable rendering of Gaussians (3DGS, Kerbl et al. 2023).

use burn::backend::Dispatch;
use burn::tensor::{Bool, Int, Tensor};
use light4gs_data::Camera;

use crate::backdrop::Backdrop;
use crate::ops::splat::{SplatInputs, SplatOps, SplatOutputs, SplatView};
use crate::scene::gaussians::{ActivatedGaussians, GaussianTensors};

/// An image, and further results that training needs.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// `[H, W, 3]`, over the background; not clamped above.
    pub image: Tensor<3>,
    /// `[H, W]`, in [0, 1].
    pub alpha: Tensor<2>,
    /// `[H, W]`: sum of view depth times blending weight, world units, not divided by alpha.
    pub depth: Tensor<2>,
    /// `[N]` in pixels: three standard deviations, rounded up; 0 outside the image; -1 for Gaussians that are not
    /// finite or have no orientation, which are not drawn.
    pub radii: Tensor<1, Int>,
    /// `[1]`: number of pairs of a Gaussian and a cell of the image that it touches; the back end chooses the size of cells. If
    /// there was room for fewer ([`Splatter::with_room_for`]), the image is incomplete.
    pub intersections: Tensor<1, Int>,
}

impl Rendering {
    /// `[N]`: which Gaussians are on the screen.
    pub fn visible(&self) -> Tensor<1, Bool> {
        self.radii.clone().greater_elem(0)
    }

    /// The number of Gaussians that were not drawn because they are not finite or have no orientation.
    pub fn invalid_count(&self) -> usize {
        self.radii.clone().equal_elem(-1).int().sum().into_scalar::<i64>() as usize
    }
}

/// Renders Gaussians over a background. On an autodiff device every input gets its gradient, so a loop and a loss of
/// your own need nothing else from this crate:
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_data::{Camera, PointCloud};
/// use light4gs_model::{GaussiansConfig, Splatter};
///
/// let device = Device::flex();
/// let cloud = PointCloud { positions: vec![[0.0; 3], [0.3, 0.0, 0.0]], colors: vec![[1.0, 0.0, 0.0]; 2] };
/// let gaussians = GaussiansConfig::new().init(&cloud, &device);
/// let camera = Camera::look_at([0.0, -4.0, 0.0].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 40, 30);
/// let rendering = Splatter::new([1.0; 3], 3).render(gaussians.tensors(), &camera, None);
/// assert_eq!(rendering.image.dims(), [30, 40, 3]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Splatter {
    background: [f32; 3],
    sh_degree: usize,
    room: Option<usize>,
    backdrop: Option<Backdrop>,
}

impl Splatter {
    /// `sh_degree` is the active degree: coefficients above it are ignored. A degree above that of the Gaussians means
    /// theirs.
    pub fn new(background: [f32; 3], sh_degree: usize) -> Self {
        Self { background, sh_degree, room: None, backdrop: None }
    }

    /// Draws other Gaussians with those of every call: they hide and are hidden, but results and gradients are about the
    /// Gaussians of the call.
    pub fn with_backdrop(self, backdrop: Option<Backdrop>) -> Self {
        Self { backdrop, ..self }
    }

    /// Reserves room for this number of [`Rendering::intersections`], so that the host need not wait until a GPU has counted
    /// them. An image with more intersections is incomplete, and so are its gradients: the caller compares the numbers, and
    /// draws such an image again. CPU back ends always have room for all.
    pub fn with_room_for(self, intersections: usize) -> Self {
        Self { room: Some(intersections), ..self }
    }

    /// Renders raw attributes (the activations happen here) through a camera.
    ///
    /// `screen_offsets [N, 2]`, normally zeros, are added to the projected positions in units of half the image;
    /// their gradient is the screen-space gradient that drives densification.
    ///
    /// # Panics
    /// If the shapes do not fit together; the message names the tensor.
    pub fn render(&self, gaussians: GaussianTensors, camera: &Camera, screen_offsets: Option<Tensor<2>>) -> Rendering {
        if self.backdrop.is_some() {
            // Its Gaussians have scales and opacities, not their logarithms.
            return self.render_activated(gaussians.activated(), camera, screen_offsets);
        }
        let GaussianTensors { means, quats, log_scales, opacity_logits, sh_dc, sh_rest, .. } = gaussians;
        let gaussians =
            ActivatedGaussians { means, quats, scales: log_scales, opacities: opacity_logits, sh_dc, sh_rest };
        let (inputs, view) = self.inputs(gaussians, camera, screen_offsets);
        self.draw(inputs, view.with_logarithms(), None)
    }

    /// Renders attributes that are activated already: [`Self::render`] for programs with activations of their own.
    ///
    /// # Panics
    /// If the shapes do not fit together; the message names the tensor.
    pub fn render_activated(
        &self,
        gaussians: ActivatedGaussians,
        camera: &Camera,
        screen_offsets: Option<Tensor<2>>,
    ) -> Rendering {
        let own = self.backdrop.is_some().then_some(gaussians.means.dims()[0]);
        let (inputs, view) = self.inputs(gaussians, camera, screen_offsets);
        self.draw(inputs, view, own)
    }

    /// Draws an image. `own`: Gaussians of the call, if others are drawn with them.
    fn draw(&self, inputs: SplatInputs<Dispatch>, view: SplatView, own: Option<usize>) -> Rendering {
        let SplatOutputs { image, alpha, depth, radii, intersections } = Dispatch::splat(inputs, view);
        let [radii, intersections] = [radii, intersections].map(Tensor::<1, Int>::from_dispatch);
        Rendering {
            image: Tensor::from_dispatch(image),
            alpha: Tensor::from_dispatch(alpha),
            depth: Tensor::from_dispatch(depth),
            radii: own.map_or(radii.clone(), |own| radii.narrow(0, 0, own)),
            intersections,
        }
    }

    /// The inputs of the operations on one image, for programs that call the operations of [`ops`](crate::ops)
    /// themselves. Where there is a backdrop, its Gaussians follow those of the call.
    ///
    /// # Panics
    /// If the shapes do not fit together; the message names the tensor.
    pub fn inputs(
        &self,
        gaussians: ActivatedGaussians,
        camera: &Camera,
        screen_offsets: Option<Tensor<2>>,
    ) -> (SplatInputs<Dispatch>, SplatView) {
        let ActivatedGaussians { means, quats, scales, opacities, sh_dc, sh_rest } = gaussians;
        let count = means.dims()[0];
        let rest = sh_rest.dims()[1];
        assert_eq!(means.dims(), [count, 3], "means must be [N, 3]");
        assert_eq!(quats.dims(), [count, 4], "quats must be [N, 4]");
        assert_eq!(scales.dims(), [count, 3], "scales must be [N, 3]");
        assert_eq!(opacities.dims(), [count, 1], "opacities must be [N, 1]");
        assert_eq!(sh_dc.dims(), [count, 1, 3], "sh_dc must be [N, 1, 3]");
        assert_eq!(sh_rest.dims(), [count, rest, 3], "sh_rest must be [N, K, 3]");
        let screen_offsets = screen_offsets.unwrap_or_else(|| Tensor::zeros([count, 2], &means.device()));
        assert_eq!(screen_offsets.dims(), [count, 2], "screen_offsets must be [N, 2]");

        let sh_degree = self.sh_degree.min((rest + 1).isqrt() - 1);
        let own = ActivatedGaussians { means, quats, scales, opacities, sh_dc, sh_rest };
        let (gaussians, screen_offsets, sh_degree) = match &self.backdrop {
            Some(backdrop) => backdrop.behind(own, screen_offsets, sh_degree),
            None => (own, screen_offsets, sh_degree),
        };
        let trained = self.backdrop.is_some().then_some(count);
        let view = SplatView { room: self.room, trained, ..SplatView::new(*camera, self.background, sh_degree) };
        let inputs = SplatInputs {
            means: gaussians.means.into_dispatch(),
            quats: gaussians.quats.into_dispatch(),
            scales: gaussians.scales.into_dispatch(),
            opacities: gaussians.opacities.into_dispatch(),
            sh_dc: gaussians.sh_dc.into_dispatch(),
            sh_rest: gaussians.sh_rest.into_dispatch(),
            screen_offsets: screen_offsets.into_dispatch(),
        };
        (inputs, view)
    }
}
