//! A short run of hostile streams: the long one is `cargo run --release -p light4gs-hostile`.

use light4gs_codec::{
    Limits, SceneData, encode,
    take::{NewSegment, SegmentTimes, Take, TakeMeta, write_take},
};
use light4gs_hostile::{
    Inputs,
    takes::Takes,
    transfers::Transfers,
    watch::{CountingAllocator, Decoder},
};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Inputs of the short run.
const INPUTS: u64 = 3000;

#[test]
fn some_thousand_streams_within_the_promises() {
    let (inputs, decoder) = (Inputs::new(14), Decoder::on_this_thread());
    let mut decoded = 0;
    for number in 0..INPUTS {
        let (kind, bytes) = inputs.input(number);
        let outcome = decoder.run(&bytes);
        let fault = outcome.fault();
        assert!(fault.is_none(), "seed 14, input {number} ({kind}, {} bytes): {fault:?}, {outcome:?}", bytes.len());
        decoded += u64::from(matches!(outcome.answer, Some(Ok(()))));
    }
    // Mutations that nothing survives would test no more than the checksums.
    assert!((INPUTS / 20..INPUTS / 2).contains(&decoded), "{decoded} decoded");
}

#[test]
fn some_thousand_transfers_give_an_error_or_the_right_picture() {
    let (transfers, decoder) = (Transfers::new(15), Decoder::on_this_thread());
    let mut decoded = 0;
    for number in 0..INPUTS {
        let transfer = transfers.transfer(number);
        let outcome = transfers.run(&transfer, &decoder);
        let fault = outcome.fault();
        assert!(fault.is_none(), "seed 15, transfer {number} ({}): {fault:?}, {outcome:?}", transfer.kind);
        decoded += u64::from(matches!(outcome.answer, Some(Ok(()))));
    }
    assert!((INPUTS / 10..INPUTS / 2).contains(&decoded), "{decoded} decoded");
}

#[test]
fn some_thousand_takes_give_an_error_or_the_right_picture() {
    let (takes, decoder) = (Takes::new(16), Decoder::on_this_thread());
    let whole = takes.whole(&decoder);
    let (mut shown, mut damaged, mut most_bytes) = (0, 0, 0);
    for number in 0..INPUTS {
        let take = takes.take(number);
        let reading = takes.run(&take, &whole, &decoder);
        let (fault, length) = (reading.outcome.fault(), take.bytes.len());
        assert!(fault.is_none(), "seed 16, take {number} ({}, {length} bytes): {fault:?}, {reading:?}", take.kind);
        shown += u64::from(reading.shows());
        damaged += u64::from(reading.shows() && !take.forged);
        most_bytes = most_bytes.max(reading.outcome.bytes);
    }
    println!("{shown} of {INPUTS} show something, {damaged} of these damaged, at most {} MiB", most_bytes >> 20);
    assert!(
        (INPUTS / 10..INPUTS).contains(&shown) && damaged > INPUTS / 20,
        "{shown} show something, {damaged} damaged"
    );
}

/// As many segments as the limits allow: SECURITY.md says in which memory their index is read.
#[test]
fn the_longest_index_is_read_within_its_promise() {
    let still = encode(&SceneData::default()).expect("sound");
    let segment = |number: u32| {
        let begin = f64::from(number);
        let times = SegmentTimes { begin, end: begin + 1.0, stream_begin: begin, stream_end: begin + 1.0, frames: 0 };
        NewSegment { times, stream: still.clone(), hidden: Vec::new() }
    };
    let segments: Vec<NewSegment> = (0..100_000).rev().map(segment).collect();
    let bytes = write_take(&TakeMeta::default(), &still, &segments, 0).expect("sound");
    let outcome = Decoder::on_this_thread().watch(|| Take::read(bytes, &Limits::default()).map(drop));
    assert!(matches!(outcome.answer, Some(Ok(()))) && outcome.bytes < 32 << 20, "{outcome:?}");
}
