//! Ray casting: one supersampled RGBA image of the procedural scene.

use super::shapes::sphere;
use super::world::{Hit, World};
use crate::camera::Camera;
use glam::Vec3;

/// Rays of a pixel along each side.
const SAMPLES: u32 = 4;
/// Everything is within this distance of the origin.
const WORLD_RADIUS: f32 = 1.3;

/// A pixel moves if at least this many of its rays, a quarter of them, meet something that moves.
const MOVING_RAYS: u32 = SAMPLES * SAMPLES / 4;

/// An image, and its mask of motion.
pub(super) struct Rendering {
    /// `[H, W, 4]` bytes with straight alpha: the share of rays that hit something.
    pub(super) rgba: Vec<u8>,
    /// `[H, W]` bytes: 255 where something moves, otherwise 0.
    pub(super) moving: Vec<u8>,
}

/// Renders the view of a camera at a time in `[0, 1]`.
pub(super) fn render(world: &World, camera: &Camera, time: f32) -> Rendering {
    // A direction is linear in the pixel before it is normalized.
    let axes = camera.rotation.transpose();
    let direction = |u: f32, v: f32| {
        let in_camera = Vec3::new((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0);
        (axes * in_camera).normalize()
    };
    render_rays(world, camera.center(), (camera.width, camera.height), time, direction)
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
    let mut rgba = Vec::with_capacity((width * height * 4) as usize);
    let mut moving = Vec::with_capacity((width * height) as usize);
    for j in 0..height {
        for i in 0..width {
            let mut sum = Vec3::ZERO;
            let mut hits = 0u32;
            let mut moving_hits = 0u32;
            for sample in 0..SAMPLES * SAMPLES {
                let within = |k: u32| (k as f32 + 0.5) / SAMPLES as f32;
                let ray = direction(i as f32 + within(sample % SAMPLES), j as f32 + within(sample / SAMPLES));
                if sphere(eye, ray, WORLD_RADIUS).is_none() {
                    continue;
                }
                let mut nearest: Option<(Hit, bool)> = None;
                for solid in &solids {
                    if solid.may_hit(eye, ray) {
                        let limit = nearest.as_ref().map_or(f32::INFINITY, |(hit, _)| hit.distance);
                        nearest = solid.hit(eye, ray, limit).map(|hit| (hit, solid.moves)).or(nearest);
                    }
                }
                if let Some((hit, moves)) = nearest {
                    sum += shade(&hit, ray);
                    hits += 1;
                    moving_hits += u32::from(moves);
                }
            }
            let color = if hits > 0 { sum / hits as f32 } else { Vec3::ZERO };
            let alpha = hits as f32 / (SAMPLES * SAMPLES) as f32;
            let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
            rgba.extend([color.x, color.y, color.z, alpha].map(byte));
            moving.push(if moving_hits >= MOVING_RAYS { 255 } else { 0 });
        }
    }
    Rendering { rgba, moving }
}

/// Lambert shading with much ambient light, and a small broad highlight that spherical harmonics can represent.
fn shade(hit: &Hit, ray: Vec3) -> Vec3 {
    let light = Vec3::new(0.377, -0.472, 0.797);
    let diffuse = 0.55 + 0.45 * hit.normal.dot(light).max(0.0);
    let half = (light - ray).normalize();
    let highlight = 0.12 * hit.normal.dot(half).max(0.0).powi(12);
    hit.color * diffuse + Vec3::splat(highlight)
}
