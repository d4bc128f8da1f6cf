"""Videos of pictures, H.264."""

import os
import subprocess

import imageio_ffmpeg

# Pictures a second, and constant rate factor: nearly without loss.
RATE, FACTOR = 30, 8


def write(pattern, path):
    """Writes the pictures of a pattern, such as `%04d.png`, from number 0 on. No bytes depend on the time or on the number of processors."""
    whole = path.with_suffix(".part.mp4")
    same = ["-map_metadata", "-1", "-fflags", "+bitexact", "-flags:v", "+bitexact"]
    subprocess.run([
        imageio_ffmpeg.get_ffmpeg_exe(), "-nostdin", "-loglevel", "error", "-y", "-framerate", str(RATE), "-i", str(pattern),
        "-c:v", "libx264", "-preset", "slow", "-crf", str(FACTOR), "-pix_fmt", "yuv420p", "-threads", "1", *same, str(whole),
    ], check=True)
    os.replace(whole, path)


def measured(path):
    """Size and number of pictures of a video."""
    reader = imageio_ffmpeg.read_frames(path)
    size = next(reader)["size"]
    reader.close()
    return size, imageio_ffmpeg.count_frames_and_secs(path)[0]
