//! Files that PyTorch wrote (`pytorch/make.py`), as they are and damaged.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use light4gs_data::{DataError, PlainTensor, read_pytorch};

fn file(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/pytorch")).join(name)
}

fn message(result: Result<BTreeMap<String, PlainTensor>, DataError>) -> String {
    result.expect_err("it is refused").to_string()
}

#[test]
fn both_containers_hold_the_same_tensors() {
    let tensors = read_pytorch(&file("zip.pth")).unwrap();
    assert_eq!(tensors, read_pytorch(&file("legacy.pth")).unwrap());
    let is = |name: &str, shape: &[usize], values: &[f32]| {
        assert_eq!(tensors[name], PlainTensor { shape: shape.to_vec(), values: values.to_vec() }, "{name}");
    };
    is("state.0.weight", &[2, 3], &[0.0, 0.25, 0.5, 0.75, 1.0, 1.25]);
    is("state.0.bias", &[2], &[-1.0, 0.5]);
    is("state.2.running_var", &[2], &[1.0, 1.0]);
    is("state.2.num_batches_tracked", &[], &[0.0]);
    is("parameter", &[2], &[1.5, -2.5]);
    is("transposed", &[4, 3], &[0.0, 4.0, 8.0, 1.0, 5.0, 9.0, 2.0, 6.0, 10.0, 3.0, 7.0, 11.0]);
    is("row", &[4], &[4.0, 5.0, 6.0, 7.0]);
    is("half", &[2], &[0.5, -3.0]);
    is("brain", &[2], &[0.5, -3.0]);
    is("double", &[1, 1], &[0.25]);
    is("long", &[2], &[-7.0, 1_048_576.0]);
    is("table", &[3], &[1.0, 0.0, 1.0]);
    is("scalar", &[], &[4.0]);
    is("empty", &[0, 5], &[]);
    assert_eq!(tensors.len(), 17, "{:?}", tensors.keys());
    let alone = read_pytorch(&file("tensor.pth")).unwrap();
    assert_eq!(alone[""].values, [1.0, 1.0, 0.0]);
}

#[test]
fn calls_are_refused_by_name_and_never_made() {
    for name in ["attack.pth", "attack_legacy.pth"] {
        let message = message(read_pytorch(&file(name)));
        for part in [name, "posix.system", "nothing of it was executed", "byte"] {
            assert!(message.contains(part), "{message}");
        }
    }
    let module = message(read_pytorch(&file("module.pth")));
    assert!(module.contains("torch.nn.modules.container.Sequential") && module.contains("state_dict()"), "{module}");
    assert!(!Path::new("/tmp/light4gs-was-attacked").exists());
}

#[test]
fn foreign_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.pth");
    let refused = |bytes: &[u8], expected: &str| {
        std::fs::write(&path, bytes).unwrap();
        let message = message(read_pytorch(&path));
        assert!(
            message.contains(expected) && message.contains("x.pth") && message.contains("save it anew"),
            "{message}"
        );
    };
    refused(b"", "no PyTorch file");
    refused(b"ply\nformat ascii 1.0\n", "no PyTorch file");
    refused(&std::fs::read(file("foreign.pth")).unwrap(), "magic number");
    // An archive without a pickle: the end of a ZIP file with no entries.
    refused(&[b"PK\x05\x06".as_slice(), &[0; 18]].concat(), "data.pkl");
    let missing = read_pytorch(Path::new("/nowhere/x.pth")).unwrap_err().to_string();
    assert!(missing.contains("/nowhere/x.pth"), "{missing}");
}

/// Every truncation and every changed byte gives an error or tensors, and never a panic.
#[test]
fn damage_is_an_error_and_not_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.pth");
    for name in ["zip.pth", "legacy.pth"] {
        let bytes = std::fs::read(file(name)).unwrap();
        for length in (0..bytes.len()).step_by(7) {
            std::fs::write(&path, &bytes[..length]).unwrap();
            let message = message(read_pytorch(&path));
            assert!(message.contains("x.pth"), "{name} cut to {length}: {message}");
        }
        for at in (0..bytes.len()).step_by(3) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << (at % 8);
            damaged[(at * 7) % bytes.len()] = 0xff;
            std::fs::write(&path, &damaged).unwrap();
            // Legacy files have no checksums, so some of these can be read.
            let _ = read_pytorch(&path);
        }
    }
}

/// Short files that ask for much: references to references, shapes without enough numbers.
#[test]
fn hostile_pickles_take_no_memory() {
    let head = {
        let legacy = std::fs::read(file("legacy.pth")).unwrap();
        // Magic number, protocol and system, up to the state dict.
        let begin = legacy.windows(2).enumerate().filter(|(_, pair)| *pair == [0x80, 0x02]).nth(3).unwrap().0;
        legacy[..begin].to_vec()
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.pth");
    let refused = |pickle: &[u8]| {
        std::fs::write(&path, [&head[..], b"\x80\x02", pickle].concat()).unwrap();
        message(read_pytorch(&path))
    };
    // Tuples in tuples in tuples, a million deep.
    let deep = [b")".as_slice(), &vec![0x85; 1_000_000], b"."].concat();
    assert!(refused(&deep).contains("storage keys"));
    // Dictionaries that each hold the one before many times, many levels deep.
    let mut nested = b"}q\x00".to_vec();
    for level in 0..30u8 {
        nested.extend(b"}(");
        for key in 0..50u8 {
            nested.extend([b'K', key, b'h', level]);
        }
        nested.extend([b'u', b'q', level + 1]);
    }
    nested.push(b'.');
    let keys = b"\x80\x02].";
    let whole = [&nested[..], keys].concat();
    assert!(refused(&whole).contains("too often"));
}
