//! Ray casting: one supersampled RGBA image of the procedural scene.

use super::light::LIGHT;
use super::shapes::sphere;
use super::solid::Hit;
use super::world::World;
use crate::camera::Camera;
use glam::Vec3;

/// Rays of a pixel along each side.
const SAMPLES: u32 = 4;
/// Everything is within this distance of the origin.
const WORLD_RADIUS: f32 = 1.3;

/// A pixel moves if one in this many of its rays, or more, meets something that moves.
const MOVING: u32 = 4;

/// An image, and its mask of motion.
pub(super) struct Rendering {
    /// `[H, W, 4]` bytes with straight alpha: the share of rays that hit something.
    pub(super) rgba: Vec<u8>,
    /// `[H, W]` bytes: 255 where something moves, otherwise 0.
    pub(super) moving: Vec<u8>,
}

/// Renders the view of a camera at a time in `[0, 1]`.
pub(super) fn render(world: &World, camera: &Camera, time: f32) -> Rendering {
    render_rays(world, camera.center(), (camera.width, camera.height), time, rays(camera))
}

/// As [`render`], for any camera: `direction` gives the unit direction in the world for a place in the image, in pixels
/// from its upper left corner.
pub(super) fn render_rays(
    world: &World,
    eye: Vec3,
    (width, height): (u32, u32),
    time: f32,
    direction: impl Fn(f32, f32) -> Vec3,
) -> Rendering {
    let solids = world.at(time);
    supersample((width, height), SAMPLES, direction, |ray| {
        sphere(eye, ray, WORLD_RADIUS)?;
        let mut nearest: Option<(Hit, bool)> = None;
        for solid in &solids {
            if solid.may_hit(eye, ray) {
                let limit = nearest.as_ref().map_or(f32::INFINITY, |(hit, _)| hit.distance);
                nearest = solid.hit(eye, ray, limit).map(|hit| (hit, solid.moves)).or(nearest);
            }
        }
        nearest.map(|(hit, moves)| (LIGHT.shade(&hit, ray), moves))
    })
}

/// The mean of `samples` × `samples` rays for each pixel. `see` gives the color that a ray meets, and whether it moves.
pub(super) fn supersample(
    (width, height): (u32, u32),
    samples: u32,
    direction: impl Fn(f32, f32) -> Vec3,
    see: impl Fn(Vec3) -> Option<(Vec3, bool)>,
) -> Rendering {
    let mut rgba = Vec::with_capacity((width * height * 4) as usize);
    let mut moving = Vec::with_capacity((width * height) as usize);
    for j in 0..height {
        for i in 0..width {
            let mut sum = Vec3::ZERO;
            let mut hits = 0u32;
            let mut moving_hits = 0u32;
            for sample in 0..samples * samples {
                let within = |k: u32| (k as f32 + 0.5) / samples as f32;
                let ray = direction(i as f32 + within(sample % samples), j as f32 + within(sample / samples));
                if let Some((color, moves)) = see(ray) {
                    sum += color;
                    hits += 1;
                    moving_hits += u32::from(moves);
                }
            }
            let color = if hits > 0 { sum / hits as f32 } else { Vec3::ZERO };
            let alpha = hits as f32 / (samples * samples) as f32;
            let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
            rgba.extend([color.x, color.y, color.z, alpha].map(byte));
            moving.push(if MOVING * moving_hits >= samples * samples { 255 } else { 0 });
        }
    }
    Rendering { rgba, moving }
}

/// The unit direction in the world for a place in a camera's image, pixels from its upper left corner.
pub(super) fn rays(camera: &Camera) -> impl Fn(f32, f32) -> Vec3 {
    // A direction is linear in the pixel before it is normalized.
    let (axes, camera) = (camera.rotation.transpose(), *camera);
    move |u, v| {
        let in_camera = Vec3::new((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0);
        (axes * in_camera).normalize()
    }
}
