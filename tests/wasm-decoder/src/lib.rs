//! The decoder as a WebAssembly module, for `.ci/wasm`: the input is a file's bytes, the output the scene as a stream
//! without loss, and the checksums of its frames.
//!
//! Node writes a stream to the address that [`input`] returns, calls [`decode`], and reads the answer at [`answer`].

use std::sync::Mutex;

/// The input and the answer.
static INPUT: Mutex<Vec<u8>> = Mutex::new(Vec::new());
static ANSWER: Mutex<Vec<u8>> = Mutex::new(Vec::new());

fn place(of: &Mutex<Vec<u8>>, make: impl FnOnce(&mut Vec<u8>)) -> *mut u8 {
    let mut bytes = of.lock().expect("one thread, which has not panicked");
    make(&mut bytes);
    bytes.as_mut_ptr()
}

/// Memory for a stream of this many bytes.
// SAFETY: no other symbol of this module has this name.
#[unsafe(no_mangle)]
pub extern "C" fn input(length: usize) -> *mut u8 {
    place(&INPUT, |bytes| *bytes = vec![0; length])
}

/// Decodes the stream in that memory. Returns the length of the answer, or the negative length of a message.
// SAFETY: as above.
#[unsafe(no_mangle)]
pub extern "C" fn decode() -> i32 {
    let input = INPUT.lock().expect("one thread, which has not panicked").clone();
    let scene = light4gs_codec::decode(&input).and_then(|scene| light4gs_codec::encode(&scene));
    let (bytes, sign) = match scene {
        Ok(bytes) => (bytes, 1),
        Err(error) => (error.to_string().into_bytes(), -1),
    };
    let length = bytes.len() as i32;
    place(&ANSWER, |answer| *answer = bytes);
    sign * length
}

/// The checksum of the Gaussians at a time, of the stream in that memory: all attributes, bit by bit. 0 where it does not decode.
// SAFETY: as above.
#[unsafe(no_mangle)]
pub extern "C" fn frame(time: f32) -> u32 {
    let input = INPUT.lock().expect("one thread, which has not panicked").clone();
    let checksum = || {
        let scene = light4gs_codec::decode(&input)?;
        let mut moved = scene.gaussians.clone();
        light4gs_codec::MotionEvaluator::new(&scene)?.apply(&scene.gaussians, time, 0..moved.len(), &mut moved);
        let numbers = moved.attributes().flat_map(|attribute| attribute.values);
        let bytes: Vec<u8> = numbers.flat_map(|number| number.to_bits().to_le_bytes()).collect();
        Ok::<_, light4gs_codec::CodecError>(crc32c::crc32c(&bytes))
    };
    checksum().unwrap_or(0)
}

/// The address of the answer.
// SAFETY: as above.
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> *mut u8 {
    place(&ANSWER, |_| ())
}
