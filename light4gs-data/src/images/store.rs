//! Images in memory: decoded when needed, composited, resized, within a memory bound.

use super::decode::decode;
use super::mask::{PixelMask, trained_pixels};
use super::rgb::RgbImage8;
use crate::error::DataError;
use crate::frame::Frame;
use crate::options::LoadOptions;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::fmt;
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// An image, and the pixels that are trained on; `None` means all.
type Masked = (Arc<RgbImage8>, Option<Arc<PixelMask>>);

/// An image file at a size.
type Key = (PathBuf, u32, u32);

/// Whether an image was decoded ahead and not yet asked for, and the time when it was decoded or last asked for. The
/// image with the smallest one is dropped first: in a shuffled order, the image that has just been used is needed last.
type Age = (bool, u64);

/// A thread-safe store of the images of frames: `[H, W, 3]` bytes, on the background, at the size
/// of the frame's camera.
///
/// Images are decoded on demand. When the bound is reached, the least recently used are dropped first, and last those
/// that were decoded ahead and not yet used. Clones share one store. An image is decoded only once even if several
/// threads ask for it.
#[derive(Clone)]
pub struct ImageStore {
    inner: Arc<Inner>,
}

struct Inner {
    background: [f32; 3],
    limit: usize,
    state: Mutex<State>,
    decoded: Condvar,
}

#[derive(Default)]
struct State {
    kept: HashMap<Key, (Masked, Age)>,
    /// The first one is dropped first.
    by_age: BTreeMap<Age, Key>,
    bytes: usize,
    clock: u64,
    /// Images that some thread is decoding right now.
    decoding: HashSet<Key>,
}

impl fmt::Debug for ImageStore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ImageStore")
            .field("limit", &self.inner.limit)
            .field("bytes", &self.bytes())
            .field("images", &self.len())
            .finish()
    }
}

impl ImageStore {
    /// An empty store that composites on the background of `options` and keeps at most
    /// `memory_limit_bytes` of images. (Images that callers still hold are not counted.)
    pub fn new(options: &LoadOptions, memory_limit_bytes: usize) -> Self {
        Self {
            inner: Arc::new(Inner {
                background: options.background,
                limit: memory_limit_bytes,
                state: Mutex::default(),
                decoded: Condvar::new(),
            }),
        }
    }

    /// The image of a frame. It is decoded now if it is not in memory.
    ///
    /// # Errors
    /// [`DataError::Image`] when the frame has no image, or it is missing, damaged, or of
    /// another size than when the dataset was opened.
    pub fn get(&self, frame: &Frame) -> Result<Arc<RgbImage8>, DataError> {
        Ok(self.get_masked(frame)?.0)
    }

    /// The image of a frame as [`Self::get`] returns it, and the pixels that may be trained on: all except those that
    /// its mask ignores, and those that its lens did not record. `None` means all of them.
    ///
    /// # Errors
    /// As [`Self::get`], also for the mask.
    pub fn get_masked(&self, frame: &Frame) -> Result<(Arc<RgbImage8>, Option<Arc<PixelMask>>), DataError> {
        let key = key(frame);
        let mut state = self.inner.lock();
        loop {
            if let Some(image) = state.touch(&key, false) {
                return Ok(image);
            }
            if !state.decoding.contains(&key) {
                break;
            }
            // The other thread is decoding already, not waiting, so this ends.
            state = self.inner.decoded.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state.decoding.insert(key.clone());
        drop(state);
        self.inner.decode_claimed(frame, key, false)
    }

    /// The images of several frames, in their order, decoded in parallel.
    ///
    /// # Errors
    /// As [`Self::get`], for the first frame with an error.
    pub fn get_many(&self, frames: &[Frame]) -> Result<Vec<Arc<RgbImage8>>, DataError> {
        frames.par_iter().map(|frame| self.get(frame)).collect()
    }

    /// Starts to decode images in the background, in order, as many as fit into the bound together; returns at once.
    /// Errors are reported by [`Self::get`] of the frame.
    pub fn prefetch(&self, frames: &[Frame]) {
        let mut bytes = 0usize;
        for frame in frames {
            bytes = bytes.saturating_add(bytes_of(frame));
            if bytes > self.inner.limit {
                break;
            }
            if self.inner.lock().touch(&key(frame), true).is_some() {
                continue;
            }
            let inner = Arc::clone(&self.inner);
            let frame = frame.clone();
            rayon::spawn(move || {
                let key = key(&frame);
                let mut state = inner.lock();
                if state.kept.contains_key(&key) || !state.decoding.insert(key.clone()) {
                    return;
                }
                drop(state);
                // `get` reports the error, to the caller that needs the image.
                let _ = inner.decode_claimed(&frame, key, true);
            });
        }
    }

    /// Bytes of the images kept now.
    pub fn bytes(&self) -> usize {
        self.inner.lock().bytes
    }

    /// Number of images kept now.
    pub fn len(&self) -> usize {
        self.inner.lock().kept.len()
    }

    /// Whether no image is kept now.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

fn key(frame: &Frame) -> Key {
    (frame.path.clone(), frame.camera.width, frame.camera.height)
}

/// Bytes of an image and its mask.
fn size_of((image, mask): &Masked) -> usize {
    image.pixels.len() + mask.as_ref().map_or(0, |mask| mask.pixels.len())
}

/// Bytes of a frame's image in the store.
fn bytes_of(frame: &Frame) -> usize {
    (frame.camera.width as usize).saturating_mul(frame.camera.height as usize).saturating_mul(3)
}

impl Inner {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Decodes an image that this thread has marked in `decoding`, and keeps it if it fits.
    fn decode_claimed(&self, frame: &Frame, key: Key, ahead: bool) -> Result<Masked, DataError> {
        /// Removes the mark, even if a decoder panics: otherwise other threads would wait for ever.
        struct Claim<'a>(&'a Inner, Key);
        impl Drop for Claim<'_> {
            fn drop(&mut self) {
                self.0.lock().decoding.remove(&self.1);
                self.0.decoded.notify_all();
            }
        }
        let claim = Claim(self, key);
        let image = (Arc::new(decode(frame, self.background)?), trained_pixels(frame)?.map(Arc::new));
        self.lock().keep(claim.1.clone(), &image, self.limit, ahead);
        Ok(image)
    }
}

impl State {
    /// The image, if it is kept: asked for now, or wanted `ahead`.
    fn touch(&mut self, key: &Key, ahead: bool) -> Option<Masked> {
        self.clock += 1;
        let (image, age) = self.kept.get_mut(key)?;
        self.by_age.remove(age);
        *age = (ahead, self.clock);
        let image = image.clone();
        self.by_age.insert((ahead, self.clock), key.clone());
        Some(image)
    }

    fn keep(&mut self, key: Key, image: &Masked, limit: usize, ahead: bool) {
        let size = size_of(image);
        if size > limit || self.kept.contains_key(&key) {
            return;
        }
        while self.bytes + size > limit {
            let Some((_, oldest)) = self.by_age.pop_first() else {
                break;
            };
            if let Some((dropped, _)) = self.kept.remove(&oldest) {
                self.bytes -= size_of(&dropped);
            }
        }
        self.clock += 1;
        self.bytes += size;
        self.by_age.insert((ahead, self.clock), key.clone());
        self.kept.insert(key, (image.clone(), (ahead, self.clock)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use glam::Vec3;
    use std::path::Path;

    /// `count` gray 8×8 images; image `i` has value `i`.
    fn frames(folder: &Path, count: u8) -> Vec<Frame> {
        (0..count)
            .map(|i| {
                let path = folder.join(format!("{i}.png"));
                let image = RgbImage8 { width: 8, height: 8, pixels: vec![i; 192] };
                image.save_png(&path).unwrap();
                let camera = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 0.7, 8, 8);
                Frame::new(i.to_string(), camera, 0.0, path, (8, 8))
            })
            .collect()
    }

    #[test]
    fn the_bound_holds_and_the_least_recently_used_goes_first() {
        let folder = tempfile::tempdir().unwrap();
        let frames = frames(folder.path(), 5);
        let store = ImageStore::new(&LoadOptions::default(), 3 * 192 + 100);
        for frame in &frames[..3] {
            store.get(frame).unwrap();
        }
        assert_eq!((store.len(), store.bytes()), (3, 576));
        let first = store.get(&frames[0]).unwrap();
        store.get(&frames[3]).unwrap();
        assert_eq!((store.len(), store.bytes()), (3, 576));
        // Image 1 was dropped, image 0 stayed: without the files, only images in memory can be returned.
        for i in 0..5 {
            std::fs::remove_file(&frames[i].path).unwrap();
        }
        assert!(Arc::ptr_eq(&first, &store.get(&frames[0]).unwrap()));
        assert!(store.get(&frames[1]).is_err());
        assert_eq!(store.get(&frames[2]).unwrap().pixels[0], 2);
        assert_eq!(store.get(&frames[3]).unwrap().pixels[0], 3);
    }

    #[test]
    fn a_store_too_small_for_one_image_still_works() {
        let folder = tempfile::tempdir().unwrap();
        let frames = frames(folder.path(), 2);
        let store = ImageStore::new(&LoadOptions::default(), 10);
        assert_eq!(store.get(&frames[1]).unwrap().pixels[0], 1);
        store.prefetch(&frames);
        assert!(store.is_empty() && store.bytes() == 0);
    }

    #[test]
    fn prefetch_and_many_threads_agree() {
        let folder = tempfile::tempdir().unwrap();
        let frames = frames(folder.path(), 40);
        let store = ImageStore::new(&LoadOptions::default(), 20 * 192);
        store.prefetch(&frames);
        let many: Vec<Frame> = (0..400).map(|i| frames[i * 7 % 40].clone()).collect();
        let images = store.get_many(&many).unwrap();
        for (frame, image) in many.iter().zip(images) {
            assert_eq!(frame.name, image.pixels[0].to_string());
        }
        assert!(store.bytes() <= 20 * 192 && store.bytes() == store.len() * 192);
        // Everything fits, so all images are in memory after a prefetch.
        let store = ImageStore::new(&LoadOptions::default(), 40 * 192);
        store.prefetch(&frames);
        for _ in 0..1000 {
            if store.len() == 40 {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        assert_eq!(store.len(), 40);
    }

    #[test]
    fn bad_images_are_errors_and_do_not_block_later_ones() {
        let folder = tempfile::tempdir().unwrap();
        let mut frames = frames(folder.path(), 4);
        let store = ImageStore::new(&LoadOptions::default(), 1 << 20);
        let bytes = std::fs::read(&frames[0].path).unwrap();
        std::fs::write(&frames[0].path, &bytes[..bytes.len() / 2]).unwrap();
        frames[1].source_width = 9;
        std::fs::remove_file(&frames[2].path).unwrap();
        store.prefetch(&frames);
        let message = |i: usize| store.get(&frames[i]).unwrap_err().to_string();
        assert!(message(0).contains("truncated") && message(0).contains("0.png"), "{}", message(0));
        assert!(message(1).contains("8 x 8 pixels, expected 9 x 8"), "{}", message(1));
        assert!(message(2).contains("2.png"), "{}", message(2));
        assert_eq!(store.get(&frames[3]).unwrap().pixels[0], 3);
        let video = Frame::without_image("v_000", frames[3].camera, 0.0);
        assert!(store.get(&video).unwrap_err().to_string().contains("no image"));
    }

    #[test]
    fn images_come_at_the_size_of_the_camera() {
        let folder = tempfile::tempdir().unwrap();
        let mut frames = frames(folder.path(), 3);
        frames[2].camera = frames[2].camera.resized(4, 2);
        let store = ImageStore::new(&LoadOptions::default(), 1 << 20);
        let image = store.get(&frames[2]).unwrap();
        assert_eq!((image.width, image.height), (4, 2));
        assert_eq!(image.pixels, [2; 24]);
    }
}
