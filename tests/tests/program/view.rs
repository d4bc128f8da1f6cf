//! `view`: what it serves while its file changes, and while others hold connections.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::PROGRAM;

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/golden-streams/compact.l4gs");

/// `light4gs view FILE`, which ends with this.
struct View {
    process: Child,
    /// Host and port.
    address: String,
}

impl View {
    /// Starts it with at most `descriptors` open files.
    fn start(file: &Path, descriptors: u32) -> Self {
        let mut process = Command::new("sh")
            .args(["-c", &format!("ulimit -n {descriptors}; exec \"$0\" view \"$1\""), PROGRAM])
            .arg(file)
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.trim().trim_start_matches("http://").trim_end_matches('/').to_owned();
        Self { process, address }
    }

    fn connect(&self) -> TcpStream {
        TcpStream::connect(&self.address).unwrap()
    }

    /// Head and body of an answer.
    fn get(&self, path: &str) -> (String, Vec<u8>) {
        let mut stream = self.connect();
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {}\r\n\r\n", self.address).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let end = answer.windows(4).position(|bytes| bytes == b"\r\n\r\n").expect("a head");
        (String::from_utf8(answer[..end].to_vec()).unwrap(), answer[end + 4..].to_vec())
    }

    /// Version and status.
    fn state(&self) -> (u64, String) {
        let state: serde_json::Value = serde_json::from_slice(&self.get("/state.json").1).unwrap();
        (state["scene"].as_u64().unwrap(), state["status"].as_str().unwrap().to_owned())
    }

    /// Clock ticks of processor time so far, a hundredth of a second each.
    fn ticks(&self) -> u64 {
        let stat = fs::read_to_string(format!("/proc/{}/stat", self.process.id())).unwrap();
        let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
        fields[11].parse::<u64>().unwrap() + fields[12].parse::<u64>().unwrap()
    }
}

impl Drop for View {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn a_file_that_becomes_something_else_leaves_the_scene_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.l4gs");
    let scene = fs::read(SCENE).unwrap();
    fs::write(&path, &scene).unwrap();
    let view = View::start(&path, 256);
    assert_eq!(view.state(), (1, String::new()));
    let (head, page) = view.get("/");
    assert!(
        head.contains("Content-Security-Policy: default-src 'none'; script-src 'self' 'wasm-unsafe-eval';"),
        "{head}"
    );
    assert!(String::from_utf8(page).unwrap().contains("<l4gs-player page"));

    let kept = |word: &str| {
        let begin = Instant::now();
        let (version, status) = view.state();
        assert!(version == 1 && status.contains(word), "{version}: {status}");
        assert_eq!(view.get("/scene.l4gs").1, scene);
        assert!(begin.elapsed() < Duration::from_secs(5));
    };
    fs::remove_file(&path).unwrap();
    kept("cannot read");
    assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
    kept("a pipe");
    fs::remove_file(&path).unwrap();
    std::os::unix::fs::symlink("/dev/zero", &path).unwrap();
    kept("a device");
    fs::remove_file(&path).unwrap();
    fs::write(&path, &scene[..scene.len() / 2]).unwrap();
    kept("cut short");
    // As long as it says, and no room on the disk.
    let mut promise = scene[..32].to_vec();
    promise[20..28].copy_from_slice(&(1_u64 << 36).to_le_bytes());
    fs::write(&path, promise).unwrap();
    fs::File::options().write(true).open(&path).unwrap().set_len(1 << 36).unwrap();
    kept("length of the stream");
    fs::write(&path, &scene).unwrap();
    assert_eq!(view.state(), (2, String::new()));
}

#[test]
fn a_server_without_descriptors_waits_without_work() {
    let view = View::start(SCENE.as_ref(), 24);
    let mut held: Vec<TcpStream> = (0..100).map(|_| view.connect()).collect();
    held.iter_mut().for_each(|stream| {
        let _ = stream.write_all(b"GET / HT");
    });
    let before = view.ticks();
    std::thread::sleep(Duration::from_secs(2));
    let spent = view.ticks() - before;
    assert!(spent < 60, "{spent} hundredths of a second of work in two seconds");
    let begin = Instant::now();
    assert_eq!(view.state().0, 1);
    assert!(begin.elapsed() < Duration::from_secs(10), "{:?}", begin.elapsed());
}
