// The view: one uniform for all kernels of an image. A kernel declares it as `view`.

struct View {
    // Columns of the rotation from world to camera. In w: focal lengths x and y, principal point x, all in pixels.
    axis_x: vec4<f32>,
    axis_y: vec4<f32>,
    axis_z: vec4<f32>,
    // Translation from world to camera. In w: principal point y.
    translation: vec4<f32>,
    // Position of the camera in the world.
    center: vec4<f32>,
    background: vec4<f32>,
    // Least slopes x/z and y/z of the Jacobian, then the largest ones.
    slopes: vec4<f32>,
    // Width and height in pixels, then in tiles.
    size: vec4<u32>,
    // Columns and rows of cells, then: which chunk of the lists is blended, and whether it is the last one.
    cells: vec4<u32>,
    // Gaussians, active SH degree, coefficients of `sh_rest` for each Gaussian, intersections that there is room for.
    counts: vec4<u32>,
    // Where alpha and depth begin in an image, behind its color; splats of a chunk.
    pixels: vec4<u32>,
}
