// The renderer's arithmetic: that of light4gs-model/src/cpu/project.rs, Gaussian by Gaussian, and blend.rs, pixel by pixel.

/** Texels of one Gaussian in the texture of what moves. */
export const TEXELS = 3;

/** @param {number} degree of the spherical harmonics */
export const harmonicsTexels = (degree) => Math.ceil((3 * (degree + 1) ** 2) / 4);

/** @param {number} degree of the spherical harmonics */
export const vertexShader = (degree) => `#version 300 es
#define DEGREE ${degree}
#define HARMONICS_TEXELS ${harmonicsTexels(degree)}
precision highp float;
precision highp int;
precision highp sampler2D;

uniform sampler2D gaussians;
uniform sampler2D harmonics;
uniform mat3 rotation;
uniform vec3 translation;
uniform vec3 eye;
uniform vec2 focal;
uniform vec2 principal;
uniform vec2 size;

layout(location = 0) in vec2 corner;
layout(location = 1) in uint gaussian;

flat out vec4 color;
out vec2 place;

const float NEAR = 0.2;
const float DILATION = 0.3;
const float FRUSTUM_MARGIN = 1.3;
const float MIN_ALPHA = 1.0 / 255.0;

float coefficients[4 * HARMONICS_TEXELS];

vec3 coefficient(int k) {
  return vec3(coefficients[3 * k], coefficients[3 * k + 1], coefficients[3 * k + 2]);
}

vec3 seen_color(vec3 direction) {
  ivec2 at = ivec2(int(gaussian & 255u) * HARMONICS_TEXELS, int(gaussian >> 8));
  for (int i = 0; i < HARMONICS_TEXELS; i++) {
    vec4 texel = texelFetch(harmonics, at + ivec2(i, 0), 0);
    coefficients[4 * i] = texel.x;
    coefficients[4 * i + 1] = texel.y;
    coefficients[4 * i + 2] = texel.z;
    coefficients[4 * i + 3] = texel.w;
  }
  vec3 sum = 0.5 + 0.2820948 * coefficient(0);
#if DEGREE > 0
  float x = direction.x, y = direction.y, z = direction.z;
  sum += 0.4886025 * (z * coefficient(2) - y * coefficient(1) - x * coefficient(3));
#endif
#if DEGREE > 1
  float xx = x * x, yy = y * y, zz = z * z;
  sum += 1.0925484 * (x * y * coefficient(4) - y * z * coefficient(5) - x * z * coefficient(7));
  sum += 0.31539157 * (2.0 * zz - xx - yy) * coefficient(6) + 0.5462742 * (xx - yy) * coefficient(8);
#endif
#if DEGREE > 2
  sum += -0.5900436 * y * (3.0 * xx - yy) * coefficient(9);
  sum += 2.8906114 * x * y * z * coefficient(10);
  sum += -0.4570458 * y * (4.0 * zz - xx - yy) * coefficient(11);
  sum += 0.37317634 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy) * coefficient(12);
  sum += -0.4570458 * x * (4.0 * zz - xx - yy) * coefficient(13);
  sum += 1.4453057 * z * (xx - yy) * coefficient(14);
  sum += -0.5900436 * x * (xx - 3.0 * yy) * coefficient(15);
#endif
  return max(sum, 0.0);
}

void main() {
  // Outside of the clip volume, until it is known to be seen.
  gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
  ivec2 at = ivec2(int(gaussian & 255u) * ${TEXELS}, int(gaussian >> 8));
  vec4 first = texelFetch(gaussians, at, 0);
  vec4 second = texelFetch(gaussians, at + ivec2(1, 0), 0);
  vec2 third = texelFetch(gaussians, at + ivec2(2, 0), 0).xy;
  float opacity = first.w;
  vec3 position = rotation * first.xyz + translation;
  if (!(position.z > NEAR) || !(opacity >= MIN_ALPHA)) return;

  // Rows of the projection's Jacobian times the view rotation, at a place not far outside of the image.
  vec2 limit = FRUSTUM_MARGIN * 0.5 * size / focal;
  vec2 slope = clamp(position.xy / position.z, -limit, limit);
  mat3 rows = transpose(rotation);
  vec3 across = focal.x / position.z * (rows[0] - slope.x * rows[2]);
  vec3 down = focal.y / position.z * (rows[1] - slope.y * rows[2]);
  mat3 covariance = mat3(second.x, second.y, second.z, second.y, second.w, third.x, second.z, third.x, third.y);
  vec3 covariance_down = covariance * down;
  float xx = dot(across, covariance * across) + DILATION;
  float xy = dot(across, covariance_down);
  float yy = dot(down, covariance_down) + DILATION;
  float determinant = xx * yy - xy * xy;
  if (!(determinant > 0.0)) return;

  // With the covariance as L Lᵀ, the circle of radius reach becomes the ellipse where alpha falls below the threshold.
  float reach = sqrt(2.0 * log(opacity / MIN_ALPHA));
  float width = sqrt(xx);
  place = reach * corner;
  vec2 offset = vec2(width * place.x, xy / width * place.x + sqrt(determinant / xx) * place.y);
  vec2 pixel = focal * position.xy / position.z + principal + offset;
  vec2 clip = 2.0 * pixel / size - 1.0;
  color = vec4(seen_color(normalize(first.xyz - eye)), opacity);
  gl_Position = vec4(clip.x, -clip.y, 0.0, 1.0);
}
`;

export const fragmentShader = `#version 300 es
precision highp float;
flat in vec4 color;
in vec2 place;
out vec4 contribution;

void main() {
  float alpha = min(0.99, color.a * exp(-0.5 * dot(place, place)));
  if (alpha < 1.0 / 255.0) discard;
  contribution = vec4(color.rgb * alpha, alpha);
}
`;

/** A triangle over everything. */
export const screenVertexShader = `#version 300 es
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
`;

/** The sums over the background, onto the canvas. */
export const screenFragmentShader = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D sums;
out vec4 color;
void main() {
  color = vec4(texelFetch(sums, ivec2(gl_FragCoord.xy), 0).rgb, 1.0);
}
`;
