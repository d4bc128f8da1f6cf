//! Cameras of a rig that are out of step.

use crate::curves::CameraCurve;
use crate::synchrony;

/// One sentence for each such camera.
pub(super) fn out_of_step(curves: &[CameraCurve]) -> impl Iterator<Item = String> {
    synchrony::out_of_step(curves).into_iter().map(|camera| {
        let name = curves.iter().find(|curve| curve.camera_id == camera.camera_id).map_or("", |curve| &curve.name);
        let way = if camera.frames_ahead > 0 { "ahead of" } else { "behind" };
        format!(
            "camera {name} is {} frames {way} the others: its images change as theirs do then (correlation {:.2}, {:.2} as \
             they are); --set data.synchronize=true moves its times",
            camera.frames_ahead.unsigned_abs(),
            camera.correlation,
            camera.unshifted
        )
    })
}
