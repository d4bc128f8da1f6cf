// The renderer's arithmetic: that of `project.rs`, Gaussian by Gaussian, and `blend.rs`, pixel by pixel, in crates/light4gs-render/src/splatting.
// Order and colors come from the worker.

import { DILATION, ENTRY, FRUSTUM_MARGIN, MAX_ALPHA, MIN_ALPHA, NEAR, ROW } from "./constants.js";

/** A number for GLSL, which wants a point or an exponent in it. @param {number} value */
const float = (value) => (Number.isInteger(value) ? value.toFixed(1) : String(value));

export const vertexShader = `#version 300 es
precision highp float;
precision highp int;

uniform mat3 rotation;
uniform vec3 translation;
uniform vec2 focal;
uniform vec2 principal;
uniform vec2 size;
// The share of a Gaussian's weight that may be left out.
uniform float tail;

uniform highp sampler2D list;
// Three corners a Gaussian, or four.
uniform bool triangles;

flat out vec4 color;
out vec2 place;

const float NEAR = ${float(NEAR)};
const float DILATION = ${float(DILATION)};
const float FRUSTUM_MARGIN = ${float(FRUSTUM_MARGIN)};
const float MIN_ALPHA = ${float(MIN_ALPHA)};

void main() {
  // Outside of the clip volume, until it is known to be seen.
  gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
  // Texels of four numbers, some for each Gaussian, and rows of some Gaussians.
  int gaussian = triangles ? gl_VertexID / 3 : gl_VertexID >> 2;
  ivec2 at = ivec2(${ENTRY / 4} * (gaussian & ${ROW - 1}), gaussian >> ${Math.log2(ROW)});
  vec4 first = texelFetch(list, at, 0);
  vec4 second = texelFetch(list, at + ivec2(1, 0), 0);
  vec4 third = texelFetch(list, at + ivec2(2, 0), 0);
  float last = texelFetch(list, at + ivec2(3, 0), 0).x;
  float opacity = first.w;
  vec3 position = rotation * first.xyz + translation;
  if (!(position.z > NEAR) || !(opacity >= MIN_ALPHA)) return;

  // Rows of the projection's Jacobian times the view rotation, at a place not far outside of the image.
  vec2 middle = (0.5 * size - principal) / focal;
  vec2 limit = FRUSTUM_MARGIN * 0.5 * size / focal;
  vec2 slope = clamp(position.xy / position.z, middle - limit, middle + limit);
  mat3 rows = transpose(rotation);
  vec3 across = focal.x / position.z * (rows[0] - slope.x * rows[2]);
  vec3 down = focal.y / position.z * (rows[1] - slope.y * rows[2]);
  // Numbers 4 to 9: xx, xy, xz, yy, yz, zz.
  mat3 covariance = mat3(second.xyz, vec3(second.y, second.w, third.x), vec3(second.z, third.xy));
  vec3 covariance_down = covariance * down;
  float xx = dot(across, covariance * across) + DILATION;
  float xy = dot(across, covariance_down);
  float yy = dot(down, covariance_down) + DILATION;
  float determinant = xx * yy - xy * xy;
  if (!(determinant > 0.0)) return;

  // With the covariance as L Lᵀ, the circle of radius reach becomes the ellipse where alpha falls below the threshold.
  float reach = sqrt(2.0 * log(opacity / max(MIN_ALPHA, tail * opacity)));
  float width = sqrt(xx);
  // A square around the circle of radius 1, or a triangle.
  int number = gl_VertexID - 3 * gaussian;
  vec2 corner = triangles
    ? (number == 0 ? vec2(-1.7320508, -1.0) : number == 1 ? vec2(1.7320508, -1.0) : vec2(0.0, 2.0))
    : vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1) * 2.0 - 1.0;
  place = reach * corner;
  vec2 offset = vec2(width * place.x, xy / width * place.x + sqrt(determinant / xx) * place.y);
  vec2 pixel = focal * position.xy / position.z + principal + offset;
  vec2 clip = 2.0 * pixel / size - 1.0;
  color = vec4(third.zw, last, opacity);
  gl_Position = vec4(clip.x, -clip.y, 0.0, 1.0);
}
`;

export const fragmentShader = `#version 300 es
precision highp float;
flat in vec4 color;
in vec2 place;
out vec4 contribution;

void main() {
  float alpha = min(${float(MAX_ALPHA)}, color.a * exp(-0.5 * dot(place, place)));
  // Nothing in place of a discard, which costs software a third more.
  contribution = alpha < ${float(MIN_ALPHA)} ? vec4(0.0) : vec4(color.rgb * alpha, alpha);
}
`;

/** A triangle over everything. */
export const screenVertexShader = `#version 300 es
out vec2 place;
void main() {
  place = vec2(gl_VertexID == 1 ? 2.0 : 0.0, gl_VertexID == 2 ? 2.0 : 0.0);
  gl_Position = vec4(2.0 * place - 1.0, 0.0, 1.0);
}
`;

/** The sums over the background, onto the canvas. */
export const screenFragmentShader = `#version 300 es
precision highp float;
uniform highp sampler2D sums;
in vec2 place;
out vec4 color;
void main() {
  color = vec4(texture(sums, place).rgb, 1.0);
}
`;
