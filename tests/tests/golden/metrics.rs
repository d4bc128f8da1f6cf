//! Golden cases c09 (MS-SSIM, D-SSIM on 8-bit images) and c13 (LPIPS) on every back end, and properties of all metrics.

use std::path::PathBuf;

use burn::tensor::{Device, Tensor, TensorData};
use light4gs_data::{PixelMask, Region};
use light4gs_tests::golden::{Golden, assert_close, cpu_devices, devices, values_of};
use light4gs_train::metrics::lpips::{Lpips, LpipsNetwork};
use light4gs_train::metrics::scores::Scores;
use light4gs_train::metrics::{
    MS_SSIM_LEAST_SIDE, Metric, PixelMap, RegionMetric, d_ssim, decibels, ms_ssim, psnr, ssim, ssim_map, ssim_valid,
};

/// An image of bytes as `[H, W, 3]` in [0, 1]; with `channels_first` the file has it as `[3, H, W]`.
fn bytes_image(golden: &Golden, key: &str, channels_first: bool, device: &Device) -> Tensor<3> {
    let shape: [usize; 3] = golden.shape(key).try_into().unwrap();
    let image = Tensor::<3>::from_data(TensorData::new(golden.values(key), shape), device) / 255.0;
    if channels_first { image.permute([1, 2, 0]) } else { image }
}

#[test]
fn multiscale_similarity() {
    let golden = Golden::open("c09_losses");
    for (name, device) in devices() {
        let [image, truth] = ["msssim.img_u8", "msssim.gt_u8"].map(|key| bytes_image(&golden, key, true, &device));
        let check = |key: &str, found: f64, tolerance: f32| {
            let key = format!("msssim.{key}");
            assert_close(&format!("{name} {key}"), &[found as f32], &golden.values(&key), tolerance);
        };
        let multiscale = ms_ssim(image.clone(), truth.clone()).unwrap().into_scalar::<f64>();
        let plain = ssim(image.clone(), truth.clone()).into_scalar::<f64>();
        check("ms_ssim", multiscale, 2e-5);
        check("d_ssim_4dgs", d_ssim(multiscale), 2e-5);
        check("d_ssim_from_ssim", d_ssim(plain), 1e-5);
        check("ssim", plain, 1e-5);
        check("psnr", psnr(image, truth), 1e-3);
    }
}

/// We may not redistribute the weights: `LIGHT4GS_LPIPS` names a file with them.
#[test]
#[ignore = "needs the weights of LPIPS: LIGHT4GS_LPIPS=FILE"]
fn learned_distance() {
    let path = PathBuf::from(std::env::var_os("LIGHT4GS_LPIPS").expect("LIGHT4GS_LPIPS names a file"));
    let golden = Golden::open("c13_lpips");
    for (name, device) in devices() {
        let [lpips] = &Lpips::load(std::slice::from_ref(&path), &device).unwrap()[..] else { panic!("one network") };
        assert_eq!(lpips.network(), LpipsNetwork::Alex);
        for pair in (0..).take_while(|pair| golden.has(&format!("pair{pair}.a"))) {
            let [a, b] = ["a", "b"].map(|side| bytes_image(&golden, &format!("pair{pair}.{side}"), false, &device));
            let layers = values_of(&lpips.layer_distances(a.clone(), b.clone()).unwrap());
            assert_close(&format!("{name} {pair}"), &layers, &golden.values(&format!("pair{pair}.per_layer")), 1e-4);
            let distance = values_of(&lpips.distance(a.clone(), b.clone()).unwrap());
            assert_close(&format!("{name} {pair}"), &distance, &golden.values(&format!("pair{pair}.lpips")), 1e-4);
            let itself = values_of(&lpips.distance(a.clone(), a.clone()).unwrap());
            assert_eq!(itself, [0.0]);
            let map = lpips.distance_map(a.clone(), b).unwrap();
            assert_eq!(map.dims()[..2], a.dims()[..2]);
            // Bilinear enlargement gives the border more weight, so this is close to the distance but not equal to it.
            assert_close(&format!("{name} {pair} map"), &values_of(&map.mean()), &distance, 0.05);
        }
    }
}

/// Random weights of VGG-16 in the layouts of torchvision and of the `lpips` package, and of the two together.
#[test]
fn weights_in_two_files_are_put_together() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, tensors: &[(String, Vec<usize>)]| {
        let data: Vec<(String, Vec<usize>, Vec<u8>)> = tensors
            .iter()
            .map(|(name, shape)| {
                let count = shape.iter().product::<usize>();
                let value = |i: usize| ((i as f32 * 12.9898).sin() * 0.1).to_le_bytes();
                (name.clone(), shape.clone(), (0..count).flat_map(value).collect())
            })
            .collect();
        let views = data.iter().map(|(name, shape, bytes)| {
            (name, safetensors::tensor::TensorView::new(safetensors::Dtype::F32, shape.clone(), bytes).unwrap())
        });
        let path = folder.path().join(name);
        std::fs::write(&path, safetensors::serialize(views, None).unwrap()).unwrap();
        path
    };
    let sizes = [3, 64, 64, 128, 128, 256, 256, 256, 512, 512, 512, 512, 512, 512];
    let places = [0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28];
    let mut network = Vec::new();
    for (layer, place) in places.iter().enumerate() {
        network.push((format!("features.{place}.weight"), vec![sizes[layer + 1], sizes[layer], 3, 3]));
        network.push((format!("features.{place}.bias"), vec![sizes[layer + 1]]));
    }
    let heads: Vec<_> = [64, 128, 256, 512, 512].into_iter().enumerate().collect();
    let heads: Vec<_> =
        heads.into_iter().map(|(tap, c)| (format!("lin{tap}.model.1.weight"), vec![1, c, 1, 1])).collect();
    let device = Device::flex();
    let (network_file, head_file) = (write("vgg16.safetensors", &network), write("vgg.safetensors", &heads));
    let found = Lpips::load(&[head_file.clone(), network_file.clone()], &device).unwrap();
    assert_eq!(found.iter().map(Lpips::network).collect::<Vec<_>>(), [LpipsNetwork::Vgg]);
    let image = |shift: f32| (Tensor::<3>::ones([20, 24, 3], &device) * 0.5) + shift;
    assert!(found[0].distance(image(0.0), image(0.1)).unwrap().into_scalar::<f32>().is_finite());
    let small = Tensor::<3>::ones([15, 40, 3], &device);
    assert!(found[0].distance(small.clone(), small).is_none());

    let message = |files: &[PathBuf]| Lpips::load(files, &device).unwrap_err().to_string();
    let alone = message(std::slice::from_ref(&head_file));
    assert!(alone.contains("vgg.safetensors") && alone.contains("convolutions"), "{alone}");
    let alone = message(std::slice::from_ref(&network_file));
    assert!(alone.contains("vgg16.safetensors") && alone.contains("heads"), "{alone}");
    network[6].1[1] = 63;
    let wrong = message(&[write("wrong.safetensors", &network), head_file]);
    assert!(wrong.contains("features.7.weight") && wrong.contains("[128, 63, 3, 3]"), "{wrong}");
    let other = message(&[write("other.safetensors", &[("weight".into(), vec![2, 2])])]);
    assert!(other.contains("other.safetensors") && other.contains("docs/metrics.md"), "{other}");
    let text = folder.path().join("text.pth");
    std::fs::write(&text, "not a model").unwrap();
    assert!(message(&[text]).contains("text.pth"));
}

fn pattern(height: usize, width: usize, shift: f32, device: &Device) -> Tensor<3> {
    let value = |i: usize| ((i as f32 * 0.7 + shift).sin() + 1.0) / 2.0;
    Tensor::from_data(TensorData::new((0..height * width * 3).map(value).collect(), [height, width, 3]), device)
}

#[test]
fn images_that_are_too_small_have_no_multiscale_similarity() {
    for (name, device) in cpu_devices() {
        let measure = |height, width| {
            let (image, truth) = (pattern(height, width, 0.0, &device), pattern(height, width, 0.1, &device));
            Scores::measure(&image, &truth, &[], &[])
        };
        let least = MS_SSIM_LEAST_SIDE;
        assert!(measure(least, least + 4).get(Metric::MsSsim).is_some(), "{name}");
        let small = measure(least - 1, least + 4);
        assert!(small.get(Metric::MsSsim).is_none() && small.get(Metric::SsimValid).is_some(), "{name}");
        assert_eq!(Metric::DSsim.format(small.get(Metric::DSsim)), "image too small");
        let tiny = measure(10, 30);
        assert!(tiny.get(Metric::SsimValid).is_none() && tiny.ssim().is_finite(), "{name}");
        let alex = Metric::Lpips(LpipsNetwork::Alex);
        assert_eq!(alex.format(tiny.get(alex)), "no weights");
    }
}

#[test]
fn valid_windows_are_the_inner_ones() {
    let device = Device::flex();
    // Windows of the padded convention at least five pixels from the border are those that lie inside.
    let (image, truth) = (pattern(24, 31, 0.0, &device), pattern(24, 31, 0.4, &device));
    let mut pixels = vec![0; 24 * 31];
    for row in 5..24 - 5 {
        pixels[row * 31 + 5..row * 31 + 31 - 5].fill(1);
    }
    let inner = PixelMask { width: 31, height: 24, pixels };
    let (inside, _) = PixelMap::of(ssim_map(image.clone(), truth.clone())).mean_over(&inner).unwrap();
    let valid = ssim_valid(image, truth).unwrap().into_scalar::<f64>();
    assert!((inside - valid).abs() < 1e-6, "{inside} against {valid}");
}

/// A mask of 40 × 40 pixels: the columns from `from` on, up to `to`.
fn columns(from: usize, to: usize) -> PixelMask {
    let pixels = (0..1600).map(|i| u8::from((from..to).contains(&(i % 40)))).collect();
    PixelMask { width: 40, height: 40, pixels }
}

/// An image whose columns from 0 up to `to` are off by `shift`, and the truth.
fn shifted(to: usize, shift: f32, device: &Device) -> [Tensor<3>; 2] {
    let truth = pattern(40, 40, 0.0, device);
    let off: Vec<f32> = columns(0, to).pixels.iter().map(|inside| shift * f32::from(*inside)).collect();
    let off = Tensor::<2>::from_data(TensorData::new(off, [40, 40]), device);
    [truth.clone() + off.unsqueeze_dim::<3>(2), truth]
}

#[test]
fn regions_are_measured_apart() {
    use RegionMetric::{Psnr, Ssim};
    for (name, device) in cpu_devices() {
        let near = |found: Option<f64>, expected: f64| {
            assert!((found.unwrap() - expected).abs() < 1e-3, "{name}: {found:?}, expected {expected}");
        };
        // The left half is off by 0.1, the right half by nothing.
        let [image, truth] = shifted(20, 0.1, &device);
        let regions =
            [(Region::Moving, columns(0, 30)), (Region::Still, columns(30, 40)), (Region::Masked, columns(40, 40))];
        let scores = Scores::measure(&image, &truth, &regions, &[]);
        near(Some(scores.psnr()), 23.0103);
        // 20 of 30 columns have a squared error of 0.01.
        near(scores.get(Metric::Of(Region::Moving, Psnr)), 21.7609);
        assert_eq!(scores.get(Metric::Of(Region::Still, Psnr)), Some(f64::INFINITY), "{name}");
        near(scores.get(Metric::WorstPsnr), 20.0);
        // Windows reach five pixels far.
        near(scores.get(Metric::Of(Region::Still, Ssim)), 1.0);
        let [moving, whole] = [scores.get(Metric::Of(Region::Moving, Ssim)).unwrap(), scores.ssim()];
        near(Some(0.75 * moving + 0.25), whole);
        assert_eq!(scores.get(Metric::Of(Region::Masked, Psnr)), None, "{name}: an empty region has no mean");
        let json = serde_json::to_value(&scores).unwrap();
        near(json["moving_psnr"].as_f64(), 21.7609);
        near(json["worst_psnr"].as_f64(), 20.0);
        assert!(json.get("masked_psnr").is_none() && json.get("moving_lpips_alex").is_none(), "{json}");
    }
}

#[test]
fn figures_over_views_are_over_all_pixels_of_a_region() {
    use RegionMetric::{Psnr, Ssim};
    let device = Device::flex();
    let measure = |shift: f32, moving: usize| {
        // Only the first columns are off, in a view in which `moving` of them move.
        let [image, truth] = shifted(moving, shift, &device);
        let regions = [(Region::Moving, columns(0, moving)), (Region::Still, columns(moving, 40))];
        let masked = (Region::Masked, columns(0, moving));
        Scores::measure(&image, &truth, &[&regions[..], &[masked]].concat(), &[])
    };
    // 10 columns with a squared error of 0.01, 30 with 0.0001, and a view in which nothing moves.
    let views = [measure(0.1, 10), measure(0.01, 30), measure(0.0, 0)];
    let over = Scores::over(views.iter());
    let near = |metric: Metric, expected: f64| {
        let found = over.get(metric).unwrap();
        assert!((found - expected).abs() < 1e-3, "{}: {found}, expected {expected}", metric.key());
    };
    near(Metric::Of(Region::Moving, Psnr), decibels((10.0 * 0.01 + 30.0 * 0.0001) / 40.0));
    assert_eq!(over.get(Metric::Of(Region::Still, Psnr)), Some(f64::INFINITY));
    // Two columns of each view are the worst.
    near(Metric::WorstPsnr, decibels((0.01 + 0.0001 + 0.0) / 3.0));
    // The field's masked metrics are means over the views that have them.
    near(Metric::Of(Region::Masked, Psnr), (20.0 + 40.0) / 2.0);
    let ssim = |view: usize| views[view].get(Metric::Of(Region::Moving, Ssim)).unwrap();
    near(Metric::Of(Region::Moving, Ssim), (10.0 * ssim(0) + 30.0 * ssim(1)) / 40.0);
    near(Metric::Of(Region::Masked, Ssim), (ssim(0) + ssim(1)) / 2.0);
    let shown: Vec<String> = Scores::columns(views.iter()).into_iter().map(Metric::label).collect();
    let regions = ["moving dB", "still dB", "moving SSIM", "still SSIM", "mPSNR dB", "mSSIM"];
    assert_eq!((&shown[7][..], &shown[8..]), ("worst 5 % dB", &regions.map(str::to_owned)[..]));
}
