//! Moving Gaussians as a zip archive with a PLY file for each time, `0000.ply`, `0001.ply`..., which Brush plays.

use std::io::{self, Write};
use std::path::Path;

use zip::ZipWriter;
use zip::write::FileOptions;

use crate::atomic::write_atomically;
use crate::error::DataError;
use crate::numbered::NumberedFiles;
use crate::ply::GaussianPly;

/// Writes the Gaussians of successive times. Entries are stored as they are, since float32 hardly gets smaller and a browser
/// shows them sooner. The file is complete or absent. One time is in memory at once.
///
/// # Errors
/// The first error of `times`; as [`GaussianPly::write`].
pub fn write_ply_zip<E: From<DataError>>(
    path: &Path,
    times: impl ExactSizeIterator<Item = Result<GaussianPly, E>>,
) -> Result<(), E> {
    let mut refused = None;
    let files = NumberedFiles::new(times.len(), "ply");
    let written = write_atomically(path, |file| {
        let mut archive = ZipWriter::new(file);
        let options = FileOptions::default().compression_method(zip::CompressionMethod::Stored);
        for (k, gaussians) in times.enumerate() {
            let bytes = gaussians.and_then(|gaussians| Ok(gaussians.bytes(path)?)).map_err(|problem| {
                refused = Some(problem);
                io::Error::other("a PLY file was refused")
            })?;
            archive.start_file(files.name(k), options)?;
            archive.write_all(&bytes)?;
        }
        archive.finish()?;
        Ok(())
    });
    match refused {
        Some(problem) => Err(problem),
        None => Ok(written?),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    fn gaussians(x: f32) -> GaussianPly {
        GaussianPly {
            means: vec![[x, 0.0, 0.0]],
            sh_dc: vec![[0.5; 3]],
            sh_rest: vec![[[0.0; 3]; 15]],
            opacity_logits: vec![2.0],
            log_scales: vec![[-3.0; 3]],
            quats: vec![[1.0, 0.0, 0.0, 0.0]],
            further: Vec::new(),
        }
    }

    /// The entries are the files that would stand in a folder, in the order of their names.
    #[test]
    fn an_archive_holds_a_file_for_each_time() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.zip");
        let times = [1.0, 2.0, 3.0].map(|x| Ok::<_, DataError>(gaussians(x)));
        write_ply_zip(&path, times.into_iter()).unwrap();
        let mut archive = zip::ZipArchive::new(std::fs::File::open(&path).unwrap()).unwrap();
        let names: Vec<String> = (0..3).map(|entry| archive.by_index(entry).unwrap().name().to_owned()).collect();
        assert_eq!((archive.len(), names), (3, ["0000.ply", "0001.ply", "0002.ply"].map(String::from).to_vec()));
        let mut bytes = Vec::new();
        archive.by_name("0001.ply").unwrap().read_to_end(&mut bytes).unwrap();
        let alone = folder.path().join("alone.ply");
        gaussians(2.0).write(&alone).unwrap();
        assert_eq!(bytes, std::fs::read(&alone).unwrap());
    }

    #[test]
    fn what_a_ply_file_cannot_hold_is_refused_and_nothing_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.zip");
        let damaged = GaussianPly { quats: Vec::new(), ..gaussians(1.0) };
        let times = [gaussians(0.0), damaged].map(Ok::<_, DataError>);
        let problem = write_ply_zip(&path, times.into_iter()).unwrap_err().to_string();
        assert!(problem.contains("1 means"), "{problem}");
        let times = [Ok(gaussians(0.0)), Err(DataError::Options { option: "time", problem: "is over".into() })];
        assert!(write_ply_zip(&path, times.into_iter()).unwrap_err().to_string().contains("is over"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
