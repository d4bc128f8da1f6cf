//! Hostile streams and odd arguments through the functions that C calls: none of them may panic, and all must answer.
//! `LIGHT4GS_HOSTILE_CASES=100000` for a long run, `LIGHT4GS_HOSTILE_SEED` for another one.

use std::ffi::{CStr, CString};
use std::ptr::{null, null_mut};

use light4gs_c::*;
use light4gs_hostile::Inputs;

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

#[test]
fn null_pointers_are_refused() {
    let stream = light4gs_codec::encode(&light4gs_codec::SceneData::default()).expect("a stream");
    // SAFETY: every pointer is null or points to what the function expects.
    unsafe {
        let mut scene = null_mut();
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
        ];
        assert!(refused.iter().all(|status| *status == L4gsStatus::Argument), "{refused:?}");
        assert_eq!(text(l4gs_last_error_kind()), "argument");
        assert!(l4gs_name(null()).is_null() && scene.is_null());
        l4gs_close(null_mut());

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
    }
    assert_eq!(L4gsLimits::from(light4gs_codec::Limits::from(l4gs_limits_large())), l4gs_limits_large());
    assert_eq!(text(l4gs_version()), env!("CARGO_PKG_VERSION"));
}
