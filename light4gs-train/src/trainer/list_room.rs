//! Room for the lists of splats in the cells of an image. Without it the host would wait until the GPU tells their length.
//!
//! A step tells the number of splats when it reads its loss, so the next step reserves somewhat more and waits for nothing. A
//! step is computed again if its lists did not fit, which is rare.

use light4gs_model::Splatter;

/// Room of a step, divided by what the step before needed: views differ, and Gaussians become more.
const MARGIN: f64 = 1.5;
/// Room falls by this factor a step, at most, where less is needed.
const SHRINKING: f64 = 0.99;

/// The number of intersections for which the images of a step have room.
#[derive(Debug)]
pub(super) struct ListRoom {
    /// Whether the device is one for whose answers the host waits. Others have room for all.
    waits: bool,
    /// `None` before the first step: its images read the number.
    room: Option<usize>,
}

impl ListRoom {
    pub(super) fn new(waits: bool) -> Self {
        Self { waits, room: None }
    }

    #[cfg(test)]
    pub(super) fn with(room: usize) -> Self {
        Self { waits: true, room: Some(room) }
    }

    /// The splatter of the next step.
    pub(super) fn reserve(&self, splatter: Splatter) -> Splatter {
        match self.room {
            Some(room) => splatter.with_room_for(room),
            None => splatter,
        }
    }

    /// Learns the number of intersections of each view of a step. Returns whether all had room; if not, the step must be
    /// computed again.
    pub(super) fn learn(&mut self, intersections: &[usize]) -> bool {
        let most = intersections.iter().copied().max().unwrap_or(0);
        let fitted = self.room.is_none_or(|room| most <= room);
        if self.waits {
            let wanted = most as f64 * MARGIN;
            let kept = self.room.unwrap_or(0) as f64 * SHRINKING;
            self.room = Some(wanted.max(kept) as usize);
        }
        fitted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn room_follows_what_was_needed() {
        let plain = || Splatter::new([0.0; 3], 0);
        let mut room = ListRoom::new(true);
        assert_eq!(room.reserve(plain()), plain());
        assert!(room.learn(&[600, 1000]));
        assert_eq!(room.reserve(plain()), plain().with_room_for(1500));
        assert!(room.learn(&[1500, 7]));
        assert_eq!(room.reserve(plain()), plain().with_room_for(2250));
        assert!(!room.learn(&[2251]));
        assert!(room.learn(&[2251]));
        (0..1000).for_each(|_| assert!(room.learn(&[100])));
        assert_eq!(room.reserve(plain()), plain().with_room_for(150));
    }

    #[test]
    fn what_has_room_for_all_reserves_nothing() {
        let plain = || Splatter::new([0.0; 3], 0);
        let mut room = ListRoom::new(false);
        assert!([10, 1000, 10].iter().all(|most| room.learn(&[*most])));
        assert_eq!(room.reserve(plain()), plain());
    }
}
