//! Lists of hidden Gaussians.

use proptest::{collection::vec, prelude::*};

use crate::take::hidden::{most_bytes, read, write};

proptest! {
    /// Runs of all lengths, as those of Gaussians in the order of space, and single bits.
    #[test]
    fn any_list_comes_back(runs in vec((any::<bool>(), 1..200_usize), 0..60)) {
        let hidden: Vec<bool> = runs.iter().flat_map(|&(bit, count)| vec![bit; count]).collect();
        let bytes = write(&hidden);
        prop_assert!(bytes.len() as u64 <= most_bytes(hidden.len() as u32));
        let found = read(&bytes, hidden.len() as u32).expect("a list");
        match hidden.contains(&true) {
            true => prop_assert_eq!(found, hidden),
            false => prop_assert!(bytes.is_empty() && found.is_empty()),
        }
    }

    #[test]
    fn no_bytes_make_it_panic(bytes in vec(any::<u8>(), 0..60), gaussians in 0..5000_u32) {
        if let Ok(hidden) = read(&bytes, gaussians) {
            prop_assert!(hidden.is_empty() || hidden.len() == gaussians as usize);
        }
    }
}

/// Bits that follow a pattern, and such that alternate without one, take no more bytes than the limit.
#[test]
fn the_longest_lists_are_within_their_limit() {
    let mut state = 1_u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 31 == 1
    };
    let hidden: Vec<bool> = (0..100_000).map(|_| random()).collect();
    let bytes = write(&hidden);
    assert!(bytes.len() < 13_000, "{} bytes for 100 000 random bits", bytes.len());
    assert_eq!(read(&bytes, 100_000).expect("a list"), hidden);
    // Hidden in clusters: 2 % of them take far less than a bit each.
    let hidden: Vec<bool> = (0..100_000).map(|index| index % 5000 < 100).collect();
    assert!(write(&hidden).len() < 300);
    // One that is cut short is found out, where the end is missing by more than the coder reads ahead.
    let bytes = write(&(0..10_000).map(|_| random()).collect::<Vec<_>>());
    assert!(read(&bytes[..bytes.len() - 40], 10_000).is_err());
}
