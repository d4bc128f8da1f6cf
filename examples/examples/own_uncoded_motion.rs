//! A motion whose coding is not written yet: the whole scene turns about the world's z axis, by a learned angle. A
//! field needs no more than this to be trained and measured in memory. Writing a file needs more, and the error names
//! it.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, s};
use light4gs::data::{Scene, Split};
use light4gs::model::{DeformationField, GaussianTensors, ScenePoints};
use light4gs::train::dataset::load_options;
use light4gs::train::trainer::Trainer;
use light4gs_examples::{Outcome, tiny_config, tiny_scene};

/// `[1]`: the angle at the last time, relative to the first, in radians.
#[derive(Module, Debug)]
struct Turntable {
    angle: Param<Tensor<1>>,
}

impl DeformationField for Turntable {
    type Config = ();

    const KINDS: &'static [&'static str] = &["turntable"];

    fn init((): &(), device: &Device) -> Self {
        Self { angle: Param::from_tensor(Tensor::zeros([1], device)) }
    }

    fn deform(&self, canonical: GaussianTensors, _: ScenePoints<'_>, time: f32) -> GaussianTensors {
        let angle = (self.angle.val() * time).unsqueeze::<2>();
        let (cos, sin) = (angle.clone().cos(), angle.sin());
        let [x, y, z] = [0, 1, 2].map(|axis| canonical.means.clone().slice(s![.., axis..axis + 1]));
        let means = vec![x.clone() * cos.clone() - y.clone() * sin.clone(), x * sin + y * cos, z];
        GaussianTensors { means: Tensor::cat(means, 1), ..canonical }
    }
}

pub(crate) fn main() -> Outcome {
    let folder = tempfile::tempdir()?;
    let config = tiny_config()?;
    let data = Scene::open(&tiny_scene(folder.path())?, &load_options(&config))?;
    let mut trainer = Trainer::<Turntable>::builder_with_field(config, data, ()).build()?;
    while trainer.step()?.is_some() {}
    let angle: f32 = trainer.scene().field.angle.val().into_scalar();
    let psnr = trainer.psnr(Split::Test)?;
    println!("turned by {angle:.4} radians, {psnr:.2} dB on test views");
    assert!(angle != 0.0 && psnr > 10.0);

    let refused = trainer.encode().unwrap_err().to_string();
    println!("{refused}");
    assert!(refused.contains("`turntable`") && refused.contains("implement `DeformationField::to_arrays`"));
    Ok(())
}
