use light4gs_data::{
    CameraCurve, CaptureFact, CaptureSummary, LoadOptions, RgbImage8, Scene, Split, SyntheticOptions, write_synthetic,
};
use light4gs_train::Stage;
use light4gs_train::compression::{AttributeRecord, BitEstimate, PlaneRecord};
use light4gs_train::config::FileProfile;
use light4gs_train::evaluation::ViewScore;
use light4gs_train::metrics::Metric;
use light4gs_train::metrics::lpips::LpipsNetwork;
use light4gs_train::metrics::scores::Scores;

use super::*;

fn image(width: u32, height: u32, shift: u8) -> RgbImage8 {
    let at = |x: u32, y: u32| [(x * 2) as u8, (y * 2) as u8, 128].map(|v: u8| v.saturating_add(shift));
    let pixels = (0..height).flat_map(|y| (0..width).flat_map(move |x| at(x, y))).collect();
    RgbImage8 { width, height, pixels }
}

fn sample() -> Report {
    let mut metrics = Vec::new();
    for iteration in (10..=300).step_by(10) {
        let mut record = MetricsRecord::new(Stage::Coarse, iteration, 1.0, 2000);
        record.loss = Some(0.3 / iteration as f64);
        metrics.push(record);
    }
    for iteration in (10..=900).step_by(10) {
        let mut record = MetricsRecord::new(Stage::Fine, iteration, 1.0, 2000 + iteration);
        record.loss = Some(0.01);
        record.psnr = Some(25.0 + iteration as f64 / 100.0);
        record.test_psnr = (iteration % 300 == 0).then_some(24.0);
        record.iterations_per_second = Some(20.0);
        metrics.push(record);
    }
    let measured = [(Metric::Psnr, 31.0), (Metric::Ssim, 0.95), (Metric::Lpips(LpipsNetwork::Alex), 0.05)];
    let scores = Scores::from_values(measured);
    let view = |name: &str| ViewScore { name: name.into(), time: 0.5, scores: scores.clone(), fitted: None };
    Report {
        title: "<b>bouncing</b> & \"more\" {{style}}".into(),
        created: "today".into(),
        device: "ndarray".into(),
        summary: vec![SummaryTile { label: "Test PSNR".into(), value: "31.0 dB".into(), hint: "20 views".into() }],
        advice: vec!["train <longer>".into()],
        capture: CaptureSummary {
            facts: vec![CaptureFact { what: "times".into(), found: "9 from 0 to 1".into() }],
            notes: vec!["1 of 9 images is <missing>".into()],
            faults: vec!["2 of 9 images are <blurred>".into()],
            problems: Vec::new(),
        },
        sections: vec![
            SectionSize { name: "gaussians".into(), bytes: 123_456 },
            SectionSize { name: "planes".into(), bytes: 1_234_567 },
        ],
        player: Some(PlayerReport { scene: b"\x89L4GS".to_vec(), cameras: "[]".into() }),
        coding: Some(CodingReport { record: coding_record(), bit_maps: vec![bit_map()] }),
        splits: vec![SplitScore {
            split: "test".into(),
            scores: scores.clone(),
            fitted: None,
            views: vec![view("r_000"), view("r_001")],
        }],
        images: vec![RenderedView {
            split: Split::Test,
            name: "r_000".into(),
            time: 0.5,
            psnr: 31.0,
            truth: image(40, 30, 0),
            render: image(40, 30, 9),
        }],
        metrics,
        config_toml: "seed = 0 # <&>\n".into(),
    }
}

fn bit_map() -> BitMap {
    BitMap { name: "0.xy".into(), width: 8, height: 4, bits: (0..32).map(|k| k as f32 / 10.0).collect() }
}

fn coding_record() -> CodingRecord {
    let plane = PlaneRecord { name: "0.xy".into(), step: 0.05, symbols: 512, latent_bytes: 3, value_bytes: 64 };
    let attribute = AttributeRecord { name: "<age>".into(), estimated_bits: 707.0, coded_bits: 700.0 };
    CodingRecord {
        profile: FileProfile::Compact,
        fit_seconds: None,
        encode_seconds: 0.5,
        estimated_bits: BitEstimate { planes: 530.0, sh: 1010.0, attributes: 707.0 },
        coded_bits: BitEstimate { planes: 536.0, sh: 1000.0, attributes: 700.0 },
        attributes: vec![attribute],
        planes: vec![plane],
        missed_quality: None,
    }
}

#[test]
fn expected_bits_stand_beside_real_ones() {
    let html = page(Path::new("report.html"), &sample()).unwrap();
    assert!(html.contains("530") && html.contains("536") && html.contains("-1.12"), "bits of the planes");
    assert!(html.contains("Bits of plane 0.xy"), "the bit map");
    assert!(html.contains("<code>&lt;age&gt;</code>") && html.contains("707"), "bits of an attribute");
}

/// Every tag that is opened is closed, in order.
fn assert_balanced(html: &str) {
    const VOID: [&str; 13] =
        ["meta", "link", "img", "input", "line", "rect", "circle", "polyline", "!doctype", "br", "hr", "path", "col"];
    let body = html.split("<script>").next().expect("a page");
    let body = match (body.find("<style>"), body.find("</style>")) {
        (Some(from), Some(to)) => format!("{}{}", &body[..from], &body[to + 8..]),
        _ => body.to_owned(),
    };
    let mut open: Vec<String> = Vec::new();
    for piece in body.split('<').skip(1) {
        let tag = piece.split('>').next().expect("a tag");
        let name = tag.trim_start_matches('/').split([' ', '/']).next().expect("a name").to_lowercase();
        if tag.starts_with('/') {
            assert_eq!(open.pop().as_deref(), Some(name.as_str()), "closing {tag}");
        } else if !tag.ends_with('/') && (name == "circle" || !VOID.contains(&name.as_str())) {
            open.push(name);
        }
    }
    assert_eq!(open, ["html", "body"]);
}

#[test]
fn a_report_is_one_well_formed_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("report.html");
    write_report(&path, &sample()).expect("a report");
    let html = std::fs::read_to_string(&path).expect("text");
    assert_balanced(&html);
    assert!(html.contains(PLAYER) && html.contains("<script type=\"application/l4gs\">iUw0R1M=</script>"));
    let html = html.replace(PLAYER, "");
    assert_eq!(html.matches("<img src=\"data:image/png;base64,").count(), 4);
    assert_eq!(html.matches("<svg ").count(), 5);
    assert!(!html.contains("http:") && !html.contains("https:") && !html.contains("//www"), "no request");
    assert!(
        !html.contains("<b>bouncing") && html.contains("&lt;b&gt;bouncing&lt;/b&gt; &amp; &quot;more&quot; {{style}}")
    );
    assert!(html.contains("seed = 0 # &lt;&amp;&gt;"));
    assert!(html.contains("1\u{202f}234\u{202f}567") && html.contains("LPIPS"));
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1);
}

#[test]
fn an_empty_report_is_a_page_too() {
    let html = page(Path::new("report.html"), &Report::default()).expect("a page");
    assert_balanced(&html);
    assert!(!html.contains("<section") && !html.contains("NaN"));
}

#[test]
fn odd_values_do_no_harm() {
    let mut report = sample();
    report.metrics.truncate(1);
    report.metrics[0].loss = Some(f64::NAN);
    report.metrics[0].psnr = Some(f64::INFINITY);
    report.splits[0].scores = Scores::from_values([(Metric::Psnr, f64::NAN)]);
    report.splits[0].views[0].scores = Scores::from_values([(Metric::Psnr, f64::INFINITY)]);
    report.sections.iter_mut().for_each(|section| section.bytes = 0);
    let html = page(Path::new("report.html"), &report).expect("a page");
    assert_balanced(&html);
    // Scripts may say NaN.
    let shown: String = html.split("<script").map(|piece| piece.split("</script>").last().expect("a piece")).collect();
    assert!(!shown.contains("NaN") && !shown.contains("inf\""));
}

#[test]
fn sizes_that_differ_are_refused_and_named() {
    let mut report = sample();
    report.images[0].render = image(30, 40, 0);
    let message = page(Path::new("report.html"), &report).expect_err("sizes").to_string();
    assert!(message.contains("r_000") && message.contains("30x40") && message.contains("40x30"), "{message}");
}

#[test]
fn the_color_map_runs_from_dark_to_bright() {
    let brightness = |value: f32| color_map::inferno(value).iter().map(|c| u32::from(*c)).sum::<u32>();
    assert_eq!(color_map::inferno(0.0), [0, 0, 4]);
    assert_eq!(color_map::inferno(7.0), [252, 255, 164]);
    assert_eq!(color_map::inferno(f32::NAN), [0, 0, 4]);
    assert!(brightness(0.2) < brightness(0.5) && brightness(0.5) < brightness(0.9));
}

#[test]
fn a_capture_is_shown_before_it_is_trained() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("<scene>");
    let small = SyntheticOptions { resolution: 16, train_frames: 4, test_frames: 2, ..Default::default() };
    write_synthetic(&root, &small).unwrap();
    let scene = Scene::open(&root, &LoadOptions::default()).unwrap();
    let curve = |i: u32| CameraCurve {
        camera_id: i,
        name: format!("cam{i}"),
        times: vec![0.0, 0.5, 1.0],
        sharpness: vec![0.6, f32::NAN, 0.5],
        changes: vec![0.01, 0.02],
        log_gains: vec![0.0, 0.1],
        ..CameraCurve::default()
    };
    let curves: Vec<CameraCurve> = (0..5).map(curve).collect();
    let capture = CaptureSummary::of(&scene).unwrap();
    let html = capture_page(&scene, &capture, &curves, &[("r & 0".into(), image(16, 16, 0))]).unwrap();
    assert_balanced(&html);
    for expected in ["4 to train on, 2 to test", "&lt;scene&gt;", "r &amp; 0", "cameras to train on", "cam4"] {
        assert!(html.contains(expected), "no {expected}");
    }
    // Two charts of up to three curves, of change and of sharpness.
    assert_eq!(html.matches("class=\"chart\"").count(), 4);
}
