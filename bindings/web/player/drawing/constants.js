// Constants of rendering and of the draw list, from light4gs-codec/src/rendering.rs and src/draw_list.rs.
// Written by tests/constants.rs: LIGHT4GS_WRITE=1 cargo test --release --package light4gs-web --test constants

/** What lies nearer along the view axis is not drawn, world units. */
export const NEAR = 0.2;

/** Variance that every projected Gaussian gets on top, square pixels. */
export const DILATION = 0.3;

/** The Jacobian is taken no further from the middle of the image, half images. */
export const FRUSTUM_MARGIN = 1.3;

/** A contribution with less alpha is skipped. */
export const MIN_ALPHA = 0.003921569;

/** Alpha is clamped here. */
export const MAX_ALPHA = 0.99;

/** Numbers of a Gaussian in a draw list, four to a texel. */
export const ENTRY = 16;

/** Gaussians of a texture's row. */
export const ROW = 256;
