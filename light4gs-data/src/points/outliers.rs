//! Points that would spoil a scene: too far away to be meant, or too many.

use super::cloud::PointCloud;
use crate::frame::Frame;
use glam::DVec3;

/// Points farther than this many times the usual distance are mistakes. Skies and mountains lie within it.
const FARTHEST: f64 = 100.0;
/// The share of points whose largest distance is usual.
const USUAL: f64 = 0.8;

impl PointCloud {
    /// Leaves out points that are not finite, or farther from the median of all than 100 times the larger of two lengths:
    /// the distance within which 80 % of the points lie, and the median distance of the cameras. Scales of positions and
    /// steps of quantization follow the extent of the cloud, so one such point costs all others their precision.
    ///
    /// Returns the number of points that are left out.
    pub(crate) fn leave_out_far(&mut self, frames: &[Frame]) -> usize {
        let finite = |p: &[f32; 3]| p.iter().all(|v| v.is_finite());
        let median = |axis: usize| quantile(self.positions.iter().filter(|p| finite(p)).map(|p| p[axis].into()), 0.5);
        let center = DVec3::new(median(0), median(1), median(2));
        let distance = |position: &[f32; 3]| DVec3::from(position.map(f64::from)).distance(center);
        let usual = quantile(self.positions.iter().filter(|p| finite(p)).map(distance), USUAL);
        let cameras = quantile(frames.iter().map(|frame| frame.camera.center().as_dvec3().distance(center)), 0.5);
        let most = FARTHEST * usual.max(cameras);
        let before = self.len();
        self.keep(|_, position| finite(position) && distance(position) <= most);
        before - self.len()
    }

    /// Keeps at most `most` points, evenly chosen in their order. Returns the number of points that are left out.
    pub(crate) fn thin(&mut self, most: usize) -> usize {
        let before = self.len();
        if before > most {
            // Point i is kept where a new multiple of before / most begins.
            let chosen = |i: usize| (i as u128 * most as u128) / before as u128;
            self.keep(|i, _| i == 0 || chosen(i) != chosen(i - 1));
        }
        before - self.len()
    }

    fn keep(&mut self, wanted: impl Fn(usize, &[f32; 3]) -> bool) {
        let kept: Vec<bool> = self.positions.iter().enumerate().map(|(i, position)| wanted(i, position)).collect();
        let mut flags = kept.iter();
        self.positions.retain(|_| flags.next() == Some(&true));
        let mut flags = kept.iter();
        self.colors.retain(|_| flags.next() == Some(&true));
    }
}

/// The smallest value that a share of the values does not exceed; 0 of none.
fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut values: Vec<f64> = values.collect();
    if values.is_empty() {
        return 0.0;
    }
    let rank = ((values.len() - 1) as f64 * share).ceil() as usize;
    *values.select_nth_unstable_by(rank, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use glam::Vec3;

    fn frames() -> Vec<Frame> {
        let eyes = [Vec3::new(4.0, 0.0, 0.0), Vec3::new(0.0, 4.0, 0.0), Vec3::new(-4.0, 0.0, 1.0)];
        eyes.map(|eye| Frame::without_image("", Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.7, 8, 8), 0.0)).to_vec()
    }

    #[test]
    fn only_points_that_no_scene_has_are_left_out() {
        let all = PointCloud::random(150, 1.3, 0);
        for (far, left_out) in [(300.0f32, 0), (1e5, 1), (1e9, 1), (1e30, 1), (f32::NAN, 1), (f32::NEG_INFINITY, 1)] {
            let mut cloud = all.clone();
            cloud.positions.insert(70, [0.0, far, 0.0]);
            cloud.colors.insert(70, [0.5; 3]);
            assert_eq!(cloud.leave_out_far(&frames()), left_out, "{far}");
            assert_eq!(cloud.colors.len(), cloud.len());
            assert_eq!(cloud == all, left_out == 1);
        }
        // A tenth of the points.
        let mut cloud = all.clone();
        cloud.positions.iter_mut().step_by(10).for_each(|position| *position = [1e6, 1e6, -1e6]);
        assert_eq!((cloud.leave_out_far(&frames()), cloud.len()), (15, 135));
        // A small thing before cameras far away, and all points in one place.
        let mut small = PointCloud::random(50, 0.01, 0);
        small.positions.push([3.0, 0.0, 0.0]);
        small.colors.push([0.5; 3]);
        assert_eq!(small.leave_out_far(&frames()), 0);
        let mut one = PointCloud { positions: vec![[1.0; 3]; 9], colors: vec![[0.5; 3]; 9] };
        assert_eq!((one.leave_out_far(&[]), PointCloud::default().leave_out_far(&[])), (0, 0));
    }

    #[test]
    fn thinned_clouds_are_spread_over_the_whole() {
        let line = PointCloud { positions: (0..10).map(|i| [i as f32; 3]).collect(), colors: vec![[0.5; 3]; 10] };
        for (most, kept) in [(10, 10), (100, 10), (1, 1), (3, 3), (7, 7)] {
            let mut cloud = line.clone();
            assert_eq!((cloud.thin(most), cloud.len(), cloud.colors.len()), (10 - kept, kept, kept));
        }
        let mut cloud = line;
        cloud.thin(5);
        assert_eq!(cloud.positions.iter().map(|p| p[0]).collect::<Vec<_>>(), [0.0, 2.0, 4.0, 6.0, 8.0]);
    }
}
