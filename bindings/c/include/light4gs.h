// Reads .l4gs files and draws them on the CPU. Made by cbindgen from bindings/c/src: do not edit.
//
// Ownership: a scene, a take and the Gaussians of a time belong to the caller, who closes each with the function of its name.
// Strings belong to the library: those of a scene or take are valid until it is closed, those of an error until the next error
// on the same thread. Buffers belong to the caller; the library keeps no pointer to them.
//
// Threads: all functions may be called from all threads, also for one scene or take at once; only closing must be the last.
//
// Errors: a function that can fail returns a status, and what its outputs hold is not specified if that is not L4GS_STATUS_OK.
// Damaged bytes, odd numbers and null pointers get an error; no function ends the program for them.

#ifndef LIGHT4GS_H
#define LIGHT4GS_H

#include <stddef.h>
#include <stdint.h>

// The status of a call. `l4gs_last_error` and `l4gs_last_error_kind` say more.
typedef enum L4gsStatus {
  // All is well.
  L4GS_STATUS_OK = 0,
  // An argument is wrong: a null pointer, a time that is not there, an illegal camera, a buffer that is too short.
  L4GS_STATUS_ARGUMENT = 1,
  // The operating system refuses to read the file.
  L4GS_STATUS_FILE = 2,
  // The bytes are no `.l4gs` stream; or they are a take where a scene is expected, or a scene where a take is.
  L4GS_STATUS_NOT_L4GS = 3,
  // The stream needs a newer version of this library.
  L4GS_STATUS_NEWER = 4,
  // The stream is damaged.
  L4GS_STATUS_DAMAGED = 5,
  // Something is larger than the limits allow.
  L4GS_STATUS_OVER_LIMIT = 6,
  // A fault of this library. The scene or take can still be used and closed.
  L4GS_STATUS_INTERNAL = 7,
} L4gsStatus;

// The Gaussians of a take at one time. They do not change until they are closed.
typedef struct L4gsGaussians L4gsGaussians;

// An open scene. It does not change until it is closed.
typedef struct L4gsScene L4gsScene;

// An open take. Nothing that can be asked of it changes until it is closed.
typedef struct L4gsTake L4gsTake;

// The most that a reader accepts. Begin with `l4gs_limits_default` or `l4gs_limits_large`, and change what you need. For a
// field that the library keeps in fewer bits, a larger number means the largest.
typedef struct L4gsLimits {
  // Bytes of a whole stream; a take may be longer, each stream in it may not.
  uint64_t file_bytes;
  // Bytes of the scene meta in the header.
  uint64_t meta_bytes;
  // Entries of the section table.
  uint64_t sections;
  // Bytes of one string.
  uint64_t string_bytes;
  // Bytes of a name.
  uint64_t name_bytes;
  // Extra entries in the scene meta.
  uint64_t extras;
  // Frames of the source.
  uint64_t frames;
  // Width and height of an image, in pixels: the source's, and one that is rendered.
  uint64_t image_side;
  // Width times height of such an image.
  uint64_t image_pixels;
  // Segments of a take, together with the slots for further ones.
  uint64_t segments;
  // Gaussians.
  uint64_t gaussians;
  // Attributes of a Gaussian.
  uint64_t attributes;
  // Numbers that an attribute has for a Gaussian.
  uint64_t attribute_width;
  // Channels of a plane.
  uint64_t channels;
  // Samples of a plane along one axis.
  uint64_t resolution;
  // Scales of the planes.
  uint64_t scales;
  // Networks of a section, and priors that use them.
  uint64_t networks;
  // Nodes, inputs or outputs of one network.
  uint64_t nodes;
  // Inputs or outputs of one layer.
  uint64_t layer_width;
  // Weights of all networks of a section.
  uint64_t layer_weights;
  // Memory that decoding takes, in bytes, without the stream itself. Showing and rendering may take eight times as much.
  uint64_t memory_bytes;
  // Time that decoding takes on one thread of a server core of 2023, as estimated from counts and sizes.
  uint64_t nanoseconds;
} L4gsLimits;

// Counts and metadata of a scene.
typedef struct L4gsInfo {
  // Bytes of the whole stream.
  uint64_t bytes;
  // Number of Gaussians, N.
  uint32_t gaussians;
  // Degree of the spherical harmonics, 0 to 3.
  uint32_t sh_degree;
  // Coefficients of a color channel, K = (degree + 1)².
  uint32_t sh_coefficients;
  // Number of frames of the source; time 0 is the first, time 1 the last.
  uint32_t frames;
  // Frames per second of the source, 0 where not known.
  float fps;
  // Smallest corner of the scene's box, world units.
  float bounds_min[3];
  // Largest corner.
  float bounds_max[3];
  // Color behind the Gaussians: red, green, blue.
  float background[3];
  // Width of the source's default camera in pixels, 0 where not known.
  uint32_t width;
  // Its height.
  uint32_t height;
  // Its horizontal field of view in radians, 0 where not known.
  float fov_x;
  // Number of attributes beyond those that every file has; see `l4gs_attribute`.
  uint32_t attributes;
  // Number of extra entries; see `l4gs_extra`.
  uint32_t extras;
  // Number of sections; see `l4gs_section`.
  uint32_t sections;
} L4gsInfo;

// Arrays of the caller for `l4gs_gaussians_gsplat` and `l4gs_gaussians_copy_gsplat`, row-major; null where one is not wanted.
typedef struct L4gsGsplatArrays {
  // `[N, 3]`, centers in world units.
  float *means;
  // `[N, 4]`, unit quaternions (w, x, y, z).
  float *quats;
  // `[N, 3]`, standard deviations in world units.
  float *scales;
  // `[N]`, in [0, 1].
  float *opacities;
  // `[N, K, 3]`, harmonics of all degrees.
  float *sh;
} L4gsGsplatArrays;

// Arrays of the caller for `l4gs_gaussians_inria` and `l4gs_gaussians_copy_inria`, row-major; null where one is not wanted.
typedef struct L4gsInriaArrays {
  // `[N, 3]`, centers in world units.
  float *means;
  // `[N, 3]`, harmonics of degree 0.
  float *f_dc;
  // `[N, 3 (K - 1)]`, the other harmonics: all coefficients of red, then green, then blue.
  float *f_rest;
  // `[N]`, logits of the opacities.
  float *opacity;
  // `[N, 3]`, natural logarithms of the standard deviations.
  float *scale;
  // `[N, 4]`, quaternions (w, x, y, z) of any length.
  float *rot;
} L4gsInriaArrays;

// An OpenCV pinhole camera: x right, y down, z forward; `x_camera = rotation · x_world + translation`. The middle of an
// image is at `cx = width / 2`, `cy = height / 2`.
typedef struct L4gsCamera {
  // Width of the image in pixels.
  uint32_t width;
  // Height of the image in pixels.
  uint32_t height;
  // Horizontal focal length in pixels.
  double fx;
  // Vertical focal length in pixels.
  double fy;
  // Horizontal principal point in pixels from the image's left edge.
  double cx;
  // Vertical principal point in pixels from the image's upper edge.
  double cy;
  // World to camera, `[3, 3]` row-major.
  double rotation[9];
  // World to camera, world units.
  double translation[3];
} L4gsCamera;

// Counts and metadata of a take. What a scene has besides stands in its base.
typedef struct L4gsTakeInfo {
  // Seconds of the take: what the file says, or the end of the last segment where that is later.
  double seconds;
  // Frames per second of the source, 0 where not known.
  float fps;
  // Number of segments; see `l4gs_take_segment`.
  uint32_t segments;
  // Number of extra entries; see `l4gs_take_extra`.
  uint32_t extras;
  // Number of Gaussians of the base. That of a time is in `l4gs_gaussians_counts`.
  uint32_t gaussians;
  // Smallest corner of the base's box, world units.
  float bounds_min[3];
  // Largest corner.
  float bounds_max[3];
  // Color behind the Gaussians: red, green, blue.
  float background[3];
  // Width of the source's default camera in pixels, 0 where not known.
  uint32_t width;
  // Its height.
  uint32_t height;
  // Its horizontal field of view in radians, 0 where not known.
  float fov_x;
} L4gsTakeInfo;

// Counts of the Gaussians of a take at one time.
typedef struct L4gsCounts {
  // Number of Gaussians, N.
  uint32_t gaussians;
  // Degree of the spherical harmonics, 0 to 3.
  uint32_t sh_degree;
  // Coefficients of a color channel, K = (degree + 1)².
  uint32_t sh_coefficients;
} L4gsCounts;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The version of this library, such as "0.1.0". The string lives as long as the program.
const char *l4gs_version(void);

// The message of the last error on this thread, in English; empty if there was none. It is valid until the next error on this
// thread.
const char *l4gs_last_error(void);

// The kind of the last error on this thread, in one word that stays the same, such as "checksum" or "over-limit" (docs/bindings.md
// lists them); empty if there was none. It is valid until the next error on this thread.
const char *l4gs_last_error_kind(void);

// The limits for files of strangers, which hold where null is passed.
struct L4gsLimits l4gs_limits_default(void);

// Limits for files that are trusted, such as your own.
struct L4gsLimits l4gs_limits_large(void);

// Opens a file. On success `*scene` is the scene, which the caller closes with `l4gs_close`; otherwise it is null.
//
// # Safety
// `path` is a string that ends with a zero (UTF-8, on Unix any bytes). `limits` is null or points to limits. `scene` points to
// a pointer.
enum L4gsStatus l4gs_open_file(const char *path,
                               const struct L4gsLimits *limits,
                               struct L4gsScene **scene);

// Opens a stream in memory. The bytes are not needed afterwards. Otherwise as `l4gs_open_file`.
//
// # Safety
// `bytes` points to `length` bytes that do not change meanwhile. `limits` is null or points to limits. `scene` points to a
// pointer.
enum L4gsStatus l4gs_open_bytes(const uint8_t *bytes,
                                size_t length,
                                const struct L4gsLimits *limits,
                                struct L4gsScene **scene);

// Closes a scene; null is allowed. All pointers that came from it become invalid.
//
// # Safety
// `scene` is null, or was opened, has not been closed, and is not in use by another thread.
void l4gs_close(struct L4gsScene *scene);

// Fills `*info` with counts and metadata.
//
// # Safety
// `scene` is open; `info` points to an `L4gsInfo`.
enum L4gsStatus l4gs_info(const struct L4gsScene *scene, struct L4gsInfo *info);

// The name of the scene, UTF-8, which belongs to the scene; null if `scene` is null.
//
// # Safety
// `scene` is null or open.
const char *l4gs_name(const struct L4gsScene *scene);

// Extra entry number `index`, from 0: key and value, UTF-8. Both belong to the scene.
//
// # Safety
// `scene` is open; `key` and `value` point to pointers.
enum L4gsStatus l4gs_extra(const struct L4gsScene *scene,
                           uint32_t index,
                           const char **key,
                           const char **value);

// Section number `index`, from 0: its name, which belongs to the scene, and its length in bytes.
//
// # Safety
// `scene` is open; `name` and `bytes` point to a pointer and a number.
enum L4gsStatus l4gs_section(const struct L4gsScene *scene,
                             uint32_t index,
                             const char **name,
                             uint64_t *bytes);

// Attribute number `index`, from 0, of those that not every file has: its name, its numbers for a Gaussian W, and its values
// `[N, W]`, which do not change with time. Name and values belong to the scene.
//
// # Safety
// `scene` is open; `name`, `width` and `values` point to a pointer, a number and a pointer.
enum L4gsStatus l4gs_attribute(const struct L4gsScene *scene,
                               uint32_t index,
                               const char **name,
                               uint32_t *width,
                               const float **values);

// Fills the arrays with the Gaussians at a time in [0, 1], as gsplat's `rasterization` takes them. A Gaussian whose quaternion
// has no direction gets the identity and opacity 0. `count` is the number of Gaussians for which there is room; it must be
// that of the scene.
//
// # Safety
// `scene` is open; `arrays` points to pointers, each of which is null or points to as many numbers as its field says.
enum L4gsStatus l4gs_gaussians_gsplat(const struct L4gsScene *scene,
                                      float time,
                                      size_t count,
                                      const struct L4gsGsplatArrays *arrays);

// Fills the arrays with the Gaussians at a time in [0, 1], as the PLY files of the original 3D Gaussian Splatting have them:
// before the activations, the same bits on every machine. `count` as above.
//
// # Safety
// As above.
enum L4gsStatus l4gs_gaussians_inria(const struct L4gsScene *scene,
                                     float time,
                                     size_t count,
                                     const struct L4gsInriaArrays *arrays);

// Draws the scene at a time in [0, 1] into `image` `[height, width, 3]`, row-major: red, green, blue, 0 or more and not clamped
// above. `length` is the number of floats for which there is room. `background` is a color, or null for that of the scene.
//
// # Safety
// `scene` is open; `camera` points to a camera; `background` is null or points to three numbers; `image` points to `length`
// numbers.
enum L4gsStatus l4gs_render(const struct L4gsScene *scene,
                            const struct L4gsCamera *camera,
                            float time,
                            const float *background,
                            float *image,
                            size_t length);

// Opens a file that is a take: minutes in one file, as a base that stands still and segments in time. Its index and its base are
// read; segments are read and decoded when they are needed. On success `*take` is the take, which the caller closes with
// `l4gs_take_close`; otherwise it is null. A file of one scene gets `L4GS_STATUS_NOT_L4GS`, of the kind "not-take"; for
// `l4gs_open_file` it is the other way round, and the kind is "is-take".
//
// `kept` is the most segments that are kept decoded, those that were used last, and at least two, as two are drawn around a join; 0 means three, which are the one that is shown
// and those beside it. The file must stay there and may grow; segments that are appended are seen by who opens it again.
//
// # Safety
// `path` is a string that ends with a zero (UTF-8, on Unix any bytes). `limits` is null or points to limits. `take` points to
// a pointer.
enum L4gsStatus l4gs_take_open_file(const char *path,
                                    const struct L4gsLimits *limits,
                                    uint32_t kept,
                                    struct L4gsTake **take);

// Opens a take in memory, of which it keeps a copy: the bytes are not needed afterwards. Otherwise as `l4gs_take_open_file`.
//
// # Safety
// `bytes` points to `length` bytes that do not change meanwhile. `limits` is null or points to limits. `take` points to a
// pointer.
enum L4gsStatus l4gs_take_open_bytes(const uint8_t *bytes,
                                     size_t length,
                                     const struct L4gsLimits *limits,
                                     uint32_t kept,
                                     struct L4gsTake **take);

// Closes a take; null is allowed. All pointers that came from it become invalid, but for Gaussians of a time.
//
// # Safety
// `take` is null, or was opened, has not been closed, and is not in use by another thread.
void l4gs_take_close(struct L4gsTake *take);

// Fills `*info` with counts and metadata.
//
// # Safety
// `take` is open; `info` points to an `L4gsTakeInfo`.
enum L4gsStatus l4gs_take_info(const struct L4gsTake *take, struct L4gsTakeInfo *info);

// The name of the take, UTF-8, which belongs to the take; null if `take` is null.
//
// # Safety
// `take` is null or open.
const char *l4gs_take_name(const struct L4gsTake *take);

// Extra entry number `index`, from 0: key and value, UTF-8. Both belong to the take.
//
// # Safety
// `take` is open; `key` and `value` point to pointers.
enum L4gsStatus l4gs_take_extra(const struct L4gsTake *take,
                                uint32_t index,
                                const char **key,
                                const char **value);

// Segment number `index`, from 0, by rising begins: it is shown from `*begin` on and before `*end`, in seconds of the take. There
// may be gaps between segments.
//
// # Safety
// `take` is open; `begin` and `end` point to numbers.
enum L4gsStatus l4gs_take_segment(const struct L4gsTake *take,
                                  uint32_t index,
                                  double *begin,
                                  double *end);

// Decodes what is shown at a time in seconds, so that it is there when it is needed: for a thread that runs ahead of the one
// that draws. Nothing happens where no segment is shown. Several threads can decode segments at the same time.
//
// # Safety
// `take` is open.
enum L4gsStatus l4gs_take_prepare(const struct L4gsTake *take,
                                  double seconds);

// Computes the Gaussians at a time in seconds: those of the base that are not hidden, and those of the segment; those of the base
// alone where no segment is. Their number changes from segment to segment, so they come as an object of their own: ask it for
// its counts, and copy what is wanted. On success the caller closes `*gaussians` with `l4gs_gaussians_close`; otherwise it is
// null.
//
// # Safety
// `take` is open; `gaussians` points to a pointer.
enum L4gsStatus l4gs_take_gaussians(const struct L4gsTake *take,
                                    double seconds,
                                    struct L4gsGaussians **gaussians);

// Fills `*counts` with the number of the Gaussians and the degree of their harmonics.
//
// # Safety
// `gaussians` is open; `counts` points to an `L4gsCounts`.
enum L4gsStatus l4gs_gaussians_counts(const struct L4gsGaussians *gaussians,
                                      struct L4gsCounts *counts);

// Fills the arrays with the Gaussians, in the convention of `l4gs_gaussians_gsplat`. `count` is the number of Gaussians for which
// there is room; it must be that of `l4gs_gaussians_counts`.
//
// # Safety
// `gaussians` is open; `arrays` points to pointers, each of which is null or points to as many numbers as its field says.
enum L4gsStatus l4gs_gaussians_copy_gsplat(const struct L4gsGaussians *gaussians,
                                           size_t count,
                                           const struct L4gsGsplatArrays *arrays);

// Fills the arrays with the Gaussians, in the convention of `l4gs_gaussians_inria`: the same bits on every machine. `count` as
// above.
//
// # Safety
// As above.
enum L4gsStatus l4gs_gaussians_copy_inria(const struct L4gsGaussians *gaussians,
                                          size_t count,
                                          const struct L4gsInriaArrays *arrays);

// Closes the Gaussians of a time; null is allowed.
//
// # Safety
// `gaussians` is null, or came from `l4gs_take_gaussians`, has not been closed, and is not in use by another thread.
void l4gs_gaussians_close(struct L4gsGaussians *gaussians);

// Draws the take at a time in seconds into `image`. Otherwise as `l4gs_render`; the background is that of the base where
// `background` is null.
//
// # Safety
// `take` is open; `camera` points to a camera; `background` is null or points to three numbers; `image` points to `length`
// numbers.
enum L4gsStatus l4gs_take_render(const struct L4gsTake *take,
                                 const struct L4gsCamera *camera,
                                 double seconds,
                                 const float *background,
                                 float *image,
                                 size_t length);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* LIGHT4GS_H */
