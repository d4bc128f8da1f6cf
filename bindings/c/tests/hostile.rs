//! Hostile streams and takes, and odd arguments, through the functions that C calls: none of them may panic, and all must answer.
//! `LIGHT4GS_HOSTILE_CASES=100000` for a long run, `LIGHT4GS_HOSTILE_SEED` for another one.

use std::ffi::{CStr, CString};
use std::ptr::{null, null_mut};
use std::time::Duration;

use light4gs_c::*;
use light4gs_codec::GaussianArrays;
use light4gs_hostile::Inputs;
use light4gs_hostile::takes::{Answer, Reading, Sums, Takes};
use light4gs_hostile::watch::{CountingAllocator, Decoder, MOST_BYTES, MOST_TIME};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// An open take has its base and three segments, each within the promise of one stream.
const MOST_BYTES_OF_A_TAKE: usize = 4 * MOST_BYTES;

/// Evaluating takes as long as Gaussians and networks need, and these may be large.
const MOST_GAUSSIANS: u32 = 256;

fn number(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).map_or(otherwise, |text| text.parse().expect("a whole number"))
}

/// Numbers that look random (Steele et al. 2014, SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    /// An ordinary number, or an odd one.
    fn odd(&mut self) -> f64 {
        const ODD: [f64; 12] =
            [0.0, -0.0, 1.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 1e-300, 3e38, 0.5];
        ODD[self.below(ODD.len())]
    }
}

fn text(pointer: *const std::ffi::c_char) -> String {
    assert!(!pointer.is_null());
    // SAFETY: strings of the library end with a zero.
    unsafe { CStr::from_ptr(pointer) }.to_str().expect("UTF-8").to_owned()
}

fn camera() -> L4gsCamera {
    L4gsCamera {
        width: 24,
        height: 17,
        fx: 30.0,
        fy: 30.0,
        cx: 12.0,
        cy: 8.5,
        rotation: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        translation: [0.0, 0.0, 4.0],
    }
}

fn odd_camera(random: &mut Random) -> L4gsCamera {
    let mut camera = camera();
    for _ in 0..1 + random.below(3) {
        let value = random.odd();
        match random.below(8) {
            0 => camera.width = [0, 1, 3, 40, 20_000, u32::MAX][random.below(6)],
            1 => camera.height = [0, 1, 3, 40, 20_000, u32::MAX][random.below(6)],
            2 => camera.fx = value,
            3 => camera.fy = value,
            4 => camera.cx = value,
            5 => camera.cy = value,
            6 => camera.rotation[random.below(9)] = value,
            _ => camera.translation[random.below(3)] = value,
        }
    }
    camera
}

/// Asks an open scene for everything. `odd` for arguments that may be wrong.
fn use_scene(scene: *mut L4gsScene, random: &mut Random, drawn: &mut u64) {
    // SAFETY: the scene is open, all pointers are null or point to room for what is written.
    unsafe {
        let mut info = L4gsInfo::default();
        assert_eq!(l4gs_info(scene, &mut info), L4gsStatus::Ok);
        text(l4gs_name(scene));
        for index in 0..info.extras.min(5) + 1 {
            let (mut key, mut value) = (null(), null());
            let status = l4gs_extra(scene, index, &mut key, &mut value);
            assert_eq!(status == L4gsStatus::Ok, index < info.extras);
        }
        for index in 0..info.attributes + 1 {
            let (mut name, mut width, mut values) = (null(), 0, null());
            let status = l4gs_attribute(scene, index, &mut name, &mut width, &mut values);
            assert_eq!(status == L4gsStatus::Ok, index < info.attributes);
        }
        for index in 0..info.sections + 1 {
            let (mut name, mut bytes) = (null(), 0);
            let status = l4gs_section(scene, index, &mut name, &mut bytes);
            assert_eq!(status == L4gsStatus::Ok, index < info.sections);
        }
        if info.gaussians > MOST_GAUSSIANS {
            return;
        }
        let (count, k) = (info.gaussians as usize, info.sh_coefficients as usize);
        let array = |width: usize| vec![0.0f32; width * count];
        let (mut means, mut quats, mut scales, mut opacities, mut sh) =
            (array(3), array(4), array(3), array(1), array(3 * k));
        let mut arrays = L4gsGsplatArrays {
            means: means.as_mut_ptr(),
            quats: quats.as_mut_ptr(),
            scales: scales.as_mut_ptr(),
            opacities: opacities.as_mut_ptr(),
            sh: sh.as_mut_ptr(),
        };
        let time = if random.below(3) == 0 { random.odd() as f32 } else { 0.37 };
        let legal = (0.0..=1.0).contains(&time);
        let status = l4gs_gaussians_gsplat(scene, time, count, &arrays);
        assert_eq!(status, if legal { L4gsStatus::Ok } else { L4gsStatus::Argument });
        arrays.sh = null_mut();
        assert_eq!(l4gs_gaussians_gsplat(scene, time, count + 1, &arrays), L4gsStatus::Argument);
        let inria = L4gsInriaArrays {
            means: means.as_mut_ptr(),
            f_dc: null_mut(),
            f_rest: sh.as_mut_ptr(),
            opacity: opacities.as_mut_ptr(),
            scale: scales.as_mut_ptr(),
            rot: quats.as_mut_ptr(),
        };
        let status = l4gs_gaussians_inria(scene, time, count, &inria);
        assert_eq!(status, if legal { L4gsStatus::Ok } else { L4gsStatus::Argument });

        let mut image = vec![0.0f32; 3 * 40 * 40];
        let camera = if random.below(2) == 0 { camera() } else { odd_camera(random) };
        let background = [random.odd() as f32; 3];
        let chosen = if random.below(2) == 0 { null() } else { background.as_ptr() };
        let status = l4gs_render(scene, &camera, time, chosen, image.as_mut_ptr(), image.len());
        assert!(
            matches!(status, L4gsStatus::Ok | L4gsStatus::Argument | L4gsStatus::OverLimit),
            "{status:?}: {}",
            text(l4gs_last_error())
        );
        if status == L4gsStatus::Ok {
            *drawn += 1;
        }
    }
}

#[test]
fn hostile_streams_get_an_answer() {
    let cases = number("LIGHT4GS_HOSTILE_CASES", 2000);
    let seed = number("LIGHT4GS_HOSTILE_SEED", 1);
    let inputs = Inputs::new(seed);
    let mut random = Random(seed);
    let folder = std::env::temp_dir().join(format!("light4gs-c-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for the test");
    let path = folder.join("hostile.l4gs");
    let c_path = CString::new(path.to_str().expect("UTF-8")).expect("no zeros");
    let (mut opened, mut drawn) = (0u64, 0u64);
    for case in 0..cases {
        let (name, bytes) = inputs.input(case);
        let mut scene = null_mut();
        // SAFETY: the bytes are there, and so is the file.
        let status = unsafe {
            if case % 64 == 0 {
                std::fs::write(&path, &bytes).expect("a file for the test");
                l4gs_open_file(c_path.as_ptr(), null(), &mut scene)
            } else {
                l4gs_open_bytes(bytes.as_ptr(), bytes.len(), null(), &mut scene)
            }
        };
        assert_eq!(status == L4gsStatus::Ok, !scene.is_null(), "case {case}");
        if status != L4gsStatus::Ok {
            let message = text(l4gs_last_error());
            assert!(
                !matches!(status, L4gsStatus::Internal | L4gsStatus::Argument | L4gsStatus::File)
                    && !message.is_empty(),
                "case {case} of seed {seed}, {name}: {status:?}: {message}"
            );
            continue;
        }
        opened += 1;
        use_scene(scene, &mut random, &mut drawn);
        // SAFETY: it is open, and nobody else knows of it.
        unsafe { l4gs_close(scene) };
    }
    std::fs::remove_dir_all(&folder).expect("the test's folder goes away");
    println!("{cases} streams of seed {seed}: {opened} opened, {drawn} drawn");
}

/// A place for a take, on its way to another thread.
struct Open(*mut L4gsTake);

// SAFETY: the functions may be called from all threads at once.
unsafe impl Send for Open {}
// SAFETY: as above.
unsafe impl Sync for Open {}

impl Open {
    fn nothing() -> Self {
        Self(null_mut())
    }

    fn take(&self) -> *mut L4gsTake {
        self.0
    }

    fn place(&mut self) -> *mut *mut L4gsTake {
        &mut self.0
    }
}

/// What a take shows at a time, as the functions of C say.
fn answer_at(take: *const L4gsTake, seconds: f64) -> Answer {
    // SAFETY: the take is open, all pointers point to room for what is written.
    unsafe {
        let mut gaussians = null_mut();
        let status = l4gs_take_gaussians(take, seconds, &mut gaussians);
        assert_eq!(status == L4gsStatus::Ok, !gaussians.is_null());
        if status != L4gsStatus::Ok {
            assert_ne!(status, L4gsStatus::Internal, "{}", text(l4gs_last_error()));
            return Answer::Refused(text(l4gs_last_error_kind()));
        }
        let mut counts = L4gsCounts::default();
        assert_eq!(l4gs_gaussians_counts(gaussians, &mut counts), L4gsStatus::Ok);
        let (count, rest) = (counts.gaussians as usize, counts.sh_coefficients as usize - 1);
        let mut found = GaussianArrays {
            means: vec![[0.0; 3]; count],
            log_scales: vec![[0.0; 3]; count],
            quats: vec![[0.0; 4]; count],
            opacity_logits: vec![0.0; count],
            sh_dc: vec![[0.0; 3]; count],
            sh_degree: counts.sh_degree as u8,
            sh_rest: vec![0.0; 3 * rest * count],
            further: Vec::new(),
        };
        let mut by_channel = vec![0.0f32; 3 * rest * count];
        let arrays = L4gsInriaArrays {
            means: found.means.as_mut_ptr().cast(),
            f_dc: found.sh_dc.as_mut_ptr().cast(),
            f_rest: by_channel.as_mut_ptr(),
            opacity: found.opacity_logits.as_mut_ptr(),
            scale: found.log_scales.as_mut_ptr().cast(),
            rot: found.quats.as_mut_ptr().cast(),
        };
        assert_eq!(l4gs_gaussians_copy_inria(gaussians, count, &arrays), L4gsStatus::Ok);
        assert_eq!(l4gs_gaussians_copy_inria(gaussians, count + 1, &arrays), L4gsStatus::Argument);
        l4gs_gaussians_close(gaussians);
        for (gaussian, by_channel) in by_channel.chunks_exact(3 * rest.max(1)).enumerate() {
            for (index, value) in by_channel.iter().enumerate() {
                found.sh_rest[3 * rest * gaussian + 3 * (index % rest) + index / rest] = *value;
            }
        }
        Answer::Shown(Sums::of(&found))
    }
}

#[test]
fn hostile_takes_get_an_error_or_the_right_gaussians() {
    let cases = number("LIGHT4GS_HOSTILE_CASES", 2000);
    let seed = number("LIGHT4GS_HOSTILE_SEED", 1);
    let (takes, decoder) = (Takes::new(seed), Decoder::on_this_thread());
    let whole = takes.whole(&decoder);
    let folder = std::env::temp_dir().join(format!("light4gs-c-takes-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for the test");
    let path = folder.join("hostile.l4gs");
    let c_path = CString::new(path.to_str().expect("UTF-8")).expect("no zeros");
    let (mut opened, mut shown, mut most_bytes, mut most_time) = (0u64, 0u64, (0, 0), (Duration::ZERO, 0));
    for case in 0..cases {
        let take = takes.take(case);
        let expected = Reading::of(&take.bytes, &take.times, &decoder).answers;
        let named = || format!("case {case} of seed {seed}, {}", take.kind);
        let mut found = Vec::new();
        let from_file = case % 16 == 0;
        let mut open = Open::nothing();
        let outcome = decoder.watch(|| {
            // SAFETY: the bytes are there, and so is the file.
            let status = unsafe {
                if from_file {
                    std::fs::write(&path, &take.bytes).expect("a file for the test");
                    l4gs_take_open_file(c_path.as_ptr(), null(), (case % 3) as u32, open.place())
                } else {
                    l4gs_take_open_bytes(take.bytes.as_ptr(), take.bytes.len(), null(), (case % 3) as u32, open.place())
                }
            };
            assert_eq!(status == L4gsStatus::Ok, !open.take().is_null());
            if status != L4gsStatus::Ok {
                assert_ne!(status, L4gsStatus::Internal, "{}", text(l4gs_last_error()));
                found = vec![Answer::Refused(text(l4gs_last_error_kind())); take.times.len()];
            }
            Ok(())
        });
        assert!(outcome.answer.is_some(), "{}: opening", named());
        let (mut bytes, mut time) = (outcome.bytes, outcome.time);
        if !open.take().is_null() {
            opened += 1;
            for (&seconds, expected) in take.times.iter().zip(&expected) {
                let outcome = decoder.watch(|| {
                    // Moving so many takes longer than this has.
                    let large = *expected == Answer::Large;
                    // SAFETY: it is open.
                    let prepared = large && unsafe { l4gs_take_prepare(open.take(), seconds) } == L4gsStatus::Ok;
                    found.push(if prepared { Answer::Large } else { answer_at(open.take(), seconds) });
                    Ok(())
                });
                assert!(outcome.answer.is_some(), "{}: {seconds} s", named());
                // Each begins with what those before have kept.
                bytes += outcome.bytes;
                time = time.max(outcome.time);
            }
            let mut image = vec![0.0f32; 3 * 24 * 17];
            if let Some(Answer::Shown(_)) = found.first() {
                // SAFETY: all pointers point to what the function expects.
                let status = unsafe {
                    l4gs_take_render(open.take(), &camera(), take.times[0], null(), image.as_mut_ptr(), image.len())
                };
                assert!(matches!(status, L4gsStatus::Ok | L4gsStatus::OverLimit), "{}: {status:?}", named());
                shown += 1;
            }
            // SAFETY: it is open, and nobody else knows of it.
            unsafe { l4gs_take_close(open.take()) };
        }
        // The codec, without pointers and without segments that are kept. From a file, the head of a segment is looked at before its
        // checksum, so another error may come.
        let same = |(found, expected): (&Answer, &Answer)| match (found, expected) {
            (Answer::Refused(_), Answer::Refused(_)) if from_file => true,
            _ => found == expected,
        };
        let right = found.len() == expected.len() && found.iter().zip(&expected).all(same);
        assert!(right, "{}: {found:?}, expected {expected:?}", named());
        let fault = takes.fault(&take, &found, &whole[take.sound]);
        assert!(fault.is_none(), "{}: {fault:?}", named());
        assert!(bytes <= MOST_BYTES_OF_A_TAKE && time <= MOST_TIME, "{}: {bytes} bytes, {time:?}", named());
        most_bytes = most_bytes.max((bytes, case));
        most_time = most_time.max((time, case));
    }
    std::fs::remove_dir_all(&folder).expect("the test's folder goes away");
    println!(
        "{cases} takes of seed {seed}: {opened} opened, {shown} drawn; at most {} MiB (case {}), {:?} (case {})",
        most_bytes.0 >> 20,
        most_bytes.1,
        most_time.0,
        most_time.1
    );
}

#[test]
fn null_pointers_are_refused() {
    let stream = light4gs_codec::encode(&light4gs_codec::SceneData::default()).expect("a stream");
    // SAFETY: every pointer is null or points to what the function expects.
    unsafe {
        let (mut scene, mut take, mut gaussians) = (null_mut(), null_mut(), null_mut());
        let refused = [
            l4gs_open_bytes(null(), 5, null(), &mut scene),
            l4gs_open_bytes(null(), 0, null(), &mut scene),
            l4gs_open_bytes(stream.as_ptr(), stream.len(), null(), null_mut()),
            l4gs_open_bytes(stream.as_ptr(), usize::MAX, null(), &mut scene),
            l4gs_open_file(null(), null(), &mut scene),
            l4gs_open_file(c"x".as_ptr(), null(), null_mut()),
            l4gs_info(null(), &mut L4gsInfo::default()),
            l4gs_extra(null(), 0, &mut null(), &mut null()),
            l4gs_section(null(), 0, &mut null(), &mut 0),
            l4gs_attribute(null(), 0, &mut null(), &mut 0, &mut null()),
            l4gs_gaussians_gsplat(null(), 0.0, 0, null()),
            l4gs_gaussians_inria(null(), 0.0, 0, null()),
            l4gs_render(null(), &camera(), 0.0, null(), [0.0; 3].as_mut_ptr(), 3),
            l4gs_take_open_bytes(null(), 5, null(), 0, &mut take),
            l4gs_take_open_bytes(stream.as_ptr(), stream.len(), null(), 0, null_mut()),
            l4gs_take_open_bytes(stream.as_ptr(), usize::MAX, null(), 0, &mut take),
            l4gs_take_open_file(null(), null(), 0, &mut take),
            l4gs_take_open_file(c"x".as_ptr(), null(), 0, null_mut()),
            l4gs_take_info(null(), &mut L4gsTakeInfo::default()),
            l4gs_take_extra(null(), 0, &mut null(), &mut null()),
            l4gs_take_segment(null(), 0, &mut 0.0, &mut 0.0),
            l4gs_take_prepare(null(), 0.0),
            l4gs_take_gaussians(null(), 0.0, &mut gaussians),
            l4gs_take_render(null(), &camera(), 0.0, null(), [0.0; 3].as_mut_ptr(), 3),
            l4gs_gaussians_counts(null(), &mut L4gsCounts::default()),
            l4gs_gaussians_copy_gsplat(null(), 0, null()),
            l4gs_gaussians_copy_inria(null(), 0, null()),
        ];
        assert!(refused.iter().all(|status| *status == L4gsStatus::Argument), "{refused:?}");
        assert_eq!(text(l4gs_last_error_kind()), "argument");
        assert!(l4gs_name(null()).is_null() && scene.is_null());
        assert!(l4gs_take_name(null()).is_null() && take.is_null() && gaussians.is_null());
        l4gs_close(null_mut());
        l4gs_take_close(null_mut());
        l4gs_gaussians_close(null_mut());

        assert_eq!(l4gs_open_bytes(stream.as_ptr(), stream.len(), null(), &mut scene), L4gsStatus::Ok);
        let refused = [
            l4gs_info(scene, null_mut()),
            l4gs_extra(scene, 0, null_mut(), &mut null()),
            l4gs_extra(scene, 0, &mut null(), null_mut()),
            l4gs_section(scene, 0, null_mut(), &mut 0),
            l4gs_attribute(scene, 0, null_mut(), &mut 0, &mut null()),
            l4gs_attribute(scene, 0, &mut null(), null_mut(), &mut null()),
            l4gs_attribute(scene, 0, &mut null(), &mut 0, null_mut()),
            l4gs_section(scene, 0, &mut null(), null_mut()),
            l4gs_gaussians_gsplat(scene, 0.0, 0, null()),
            l4gs_gaussians_inria(scene, 0.0, 0, null()),
            l4gs_render(scene, null(), 0.0, null(), [0.0; 3].as_mut_ptr(), 3),
            l4gs_render(scene, &camera(), 0.0, null(), null_mut(), 3),
            l4gs_render(scene, &camera(), 0.0, null(), [0.0; 3].as_mut_ptr(), 3),
        ];
        assert!(refused.iter().all(|status| *status == L4gsStatus::Argument), "{refused:?}");
        l4gs_close(scene);
    }
}

/// A take of the conformance set: its file, and its bytes.
fn segments() -> (CString, Vec<u8>) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/conformance/streams/takes/segments.l4gs");
    (CString::new(path).expect("no zeros"), std::fs::read(path).expect("a take"))
}

#[test]
fn odd_arguments_for_takes_are_refused() {
    let (_, bytes) = segments();
    let (mut take, mut gaussians) = (null_mut(), null_mut());
    let mut image = [0.0f32; 3 * 24 * 17];
    // SAFETY: every pointer is null or points to what the function expects.
    unsafe {
        assert_eq!(l4gs_take_open_bytes(bytes.as_ptr(), bytes.len(), null(), 1, &mut take), L4gsStatus::Ok);
        for seconds in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let (picture, length) = (image.as_mut_ptr(), image.len());
            let refused = [
                l4gs_take_prepare(take, seconds),
                l4gs_take_gaussians(take, seconds, &mut gaussians),
                l4gs_take_render(take, &camera(), seconds, null(), picture, length),
            ];
            assert!(refused.iter().all(|status| *status == L4gsStatus::Argument), "{refused:?}");
            assert!(text(l4gs_last_error()).contains("finite number of seconds") && gaussians.is_null());
        }
        assert_eq!(l4gs_take_gaussians(take, 0.1, &mut gaussians), L4gsStatus::Ok);
        let (picture, length) = (image.as_mut_ptr(), image.len());
        let refused = [
            l4gs_take_info(take, null_mut()),
            l4gs_take_extra(take, 0, null_mut(), &mut null()),
            l4gs_take_extra(take, 0, &mut null(), null_mut()),
            l4gs_take_extra(take, u32::MAX, &mut null(), &mut null()),
            l4gs_take_segment(take, 0, null_mut(), &mut 0.0),
            l4gs_take_segment(take, 0, &mut 0.0, null_mut()),
            l4gs_take_segment(take, 2, &mut 0.0, &mut 0.0),
            l4gs_take_gaussians(take, 0.1, null_mut()),
            l4gs_take_render(take, null(), 0.1, null(), picture, length),
            l4gs_take_render(take, &camera(), 0.1, null(), null_mut(), length),
            l4gs_take_render(take, &camera(), 0.1, null(), picture, length - 1),
            l4gs_take_render(take, &camera(), 0.1, [f32::NAN; 3].as_ptr(), picture, length),
            l4gs_gaussians_counts(gaussians, null_mut()),
            l4gs_gaussians_copy_gsplat(gaussians, 0, null()),
            l4gs_gaussians_copy_inria(gaussians, 0, null()),
        ];
        assert!(refused.iter().all(|status| *status == L4gsStatus::Argument), "{refused:?}");
        // They outlive the take.
        l4gs_take_close(take);
        let mut counts = L4gsCounts::default();
        assert_eq!(l4gs_gaussians_counts(gaussians, &mut counts), L4gsStatus::Ok);
        assert!(counts.gaussians > 0);
        l4gs_gaussians_close(gaussians);
    }
}

#[test]
fn several_threads_use_one_take() {
    let (path, _) = segments();
    let mut open = Open::nothing();
    // SAFETY: every pointer points to what the function expects.
    assert_eq!(unsafe { l4gs_take_open_file(path.as_ptr(), null(), 1, open.place()) }, L4gsStatus::Ok);
    let open = &open;
    let times = [0.1, 0.6, 0.4, 0.2];
    let alone = times.map(|seconds| answer_at(open.take(), seconds));
    std::thread::scope(|scope| {
        // One runs ahead, while the others draw; only one segment is kept.
        scope.spawn(move || {
            for round in 0..50 {
                // SAFETY: it is open.
                let status = unsafe { l4gs_take_prepare(open.take(), times[round % 4]) };
                assert_eq!(status, L4gsStatus::Ok);
            }
        });
        for first in 0..3 {
            let alone = &alone;
            scope.spawn(move || {
                for round in first..first + 25 {
                    assert_eq!(answer_at(open.take(), times[round % 4]), alone[round % 4]);
                }
            });
        }
    });
    // SAFETY: it is open, and nobody uses it any more.
    unsafe { l4gs_take_close(open.take()) };
}

#[test]
fn a_missing_file_and_low_limits_are_named() {
    let stream = light4gs_codec::encode(&light4gs_codec::SceneData::default()).expect("a stream");
    let limits = L4gsLimits { file_bytes: 10, ..l4gs_limits_default() };
    let mut scene = null_mut();
    // SAFETY: every pointer points to what the function expects.
    unsafe {
        assert_eq!(l4gs_open_file(c"/no/such/file".as_ptr(), null(), &mut scene), L4gsStatus::File);
        assert!(text(l4gs_last_error()).contains("/no/such/file"));
        assert_eq!(text(l4gs_last_error_kind()), "io");
        assert_eq!(l4gs_open_bytes(stream.as_ptr(), stream.len(), &limits, &mut scene), L4gsStatus::OverLimit);
        assert_eq!(text(l4gs_last_error_kind()), "over-limit");

        let (path, bytes) = segments();
        let mut take = null_mut();
        assert_eq!(l4gs_take_open_file(c"/no/such/file".as_ptr(), null(), 0, &mut take), L4gsStatus::File);
        assert!(text(l4gs_last_error()).contains("/no/such/file"));
        let limits = L4gsLimits { segments: 1, ..l4gs_limits_default() };
        assert_eq!(l4gs_take_open_file(path.as_ptr(), &limits, 0, &mut take), L4gsStatus::OverLimit);
        assert_eq!(l4gs_take_open_bytes(bytes.as_ptr(), bytes.len(), &limits, 0, &mut take), L4gsStatus::OverLimit);
        assert!(take.is_null());
        // Each says what opens the other.
        assert_eq!(l4gs_take_open_bytes(stream.as_ptr(), stream.len(), null(), 0, &mut take), L4gsStatus::NotL4gs);
        assert_eq!(text(l4gs_last_error_kind()), "not-take");
        assert!(text(l4gs_last_error()).contains("l4gs_open_file"));
        assert_eq!(l4gs_open_file(path.as_ptr(), null(), &mut scene), L4gsStatus::NotL4gs);
        assert_eq!(text(l4gs_last_error_kind()), "is-take");
        assert!(text(l4gs_last_error()).contains("l4gs_take_open_file"));
    }
    assert_eq!(L4gsLimits::from(light4gs_codec::Limits::from(l4gs_limits_large())), l4gs_limits_large());
    assert_eq!(text(l4gs_version()), env!("CARGO_PKG_VERSION"));
}
