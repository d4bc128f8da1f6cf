//! A short run of hostile streams: the long one is `cargo run --release -p light4gs-hostile`.

use light4gs_hostile::{
    Inputs,
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
