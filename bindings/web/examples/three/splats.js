// The Gaussians of a .l4gs scene as a mesh of three.js. The worker of light4gs sorts them and evaluates their colors; the shader
// projects them as the player does, with the matrices of mesh and camera. Opaque objects hide them, pixel by pixel.

import { Follower } from "light4gs-player";
import * as THREE from "three";

/** Gaussians in a row of the texture, four texels each: so come the lists of `scene.frame`. */
const ROW = 256;

const vertexShader = `
precision highp float;
precision highp int;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform vec2 viewport;
uniform bool linear;
uniform highp sampler2D list;
flat out vec4 color;
out vec2 place;

vec3 toLinear(vec3 c) { return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c)); }

void main() {
  gl_Position = vec4(0.0, 0.0, 2.0, 1.0); // outside, until it is known to be seen
  int gaussian = gl_VertexID >> 2;
  ivec2 at = ivec2(4 * (gaussian % ${ROW}), gaussian / ${ROW});
  vec4 first = texelFetch(list, at, 0); // center, opacity
  vec4 second = texelFetch(list, at + ivec2(1, 0), 0); // covariance xx, xy, xz, yy
  vec4 third = texelFetch(list, at + ivec2(2, 0), 0); // yz, zz, red, green
  vec4 seen = modelViewMatrix * vec4(first.xyz, 1.0);
  float depth = -seen.z;
  if (depth < 0.2 || first.w < 1.0 / 255.0) return;

  // Rows of the projection's Jacobian, in pixels, times the matrix to the camera, at a place not far outside of the image.
  vec2 scale = vec2(projectionMatrix[0][0], projectionMatrix[1][1]);
  vec2 middle = projectionMatrix[2].xy / scale;
  vec2 limit = 1.3 / scale;
  vec2 slope = clamp(seen.xy / depth, middle - limit, middle + limit);
  mat3 rows = transpose(mat3(modelViewMatrix));
  vec2 focal = 0.5 * scale * viewport / depth;
  vec3 across = focal.x * (rows[0] + slope.x * rows[2]);
  vec3 up = focal.y * (rows[1] + slope.y * rows[2]);
  mat3 covariance = mat3(second.xyz, vec3(second.y, second.w, third.x), vec3(second.z, third.xy));
  float xx = dot(across, covariance * across) + 0.3;
  float xy = dot(across, covariance * up);
  float yy = dot(up, covariance * up) + 0.3;
  float determinant = xx * yy - xy * xy;
  if (determinant <= 0.0) return;

  // With the covariance as L Lᵀ, a square around the circle where alpha falls to 1/255 becomes the quad to draw.
  place = sqrt(2.0 * log(255.0 * first.w)) * (vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1) * 2.0 - 1.0);
  vec2 offset = vec2(sqrt(xx) * place.x, xy / sqrt(xx) * place.x + sqrt(determinant / xx) * place.y);
  vec3 rgb = vec3(third.zw, texelFetch(list, at + ivec2(3, 0), 0).x);
  color = vec4(linear ? toLinear(rgb) : rgb, first.w);
  gl_Position = projectionMatrix * seen;
  gl_Position.xy += 2.0 * offset / viewport * gl_Position.w;
}`;

const fragmentShader = `
precision highp float;
flat in vec4 color;
in vec2 place;
out vec4 contribution;
void main() {
  float alpha = min(0.99, color.a * exp(-0.5 * dot(place, place)));
  contribution = alpha < 1.0 / 255.0 ? vec4(0.0) : vec4(color.rgb * alpha, alpha);
}`;

export async function createSplats(scene, camera) {
  const geometry = new THREE.BufferGeometry();
  /** A texture for so many rows, and two triangles for each Gaussian. */
  const textureOf = (rows) => {
    const indices = new Uint32Array(6 * ROW * rows);
    for (let i = 0; i < ROW * rows; i++) indices.set([4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 2, 4 * i + 1, 4 * i + 3], 6 * i);
    geometry.dispose();
    geometry.setIndex(new THREE.BufferAttribute(indices, 1));
    return new THREE.DataTexture(new Float32Array(16 * ROW * rows), 4 * ROW, rows, THREE.RGBAFormat, THREE.FloatType);
  };
  let list = textureOf(Math.max(Math.ceil(scene.count / ROW), 1));
  geometry.boundingBox = new THREE.Box3(...scene.info.bounds.map((corner) => new THREE.Vector3(...corner)));
  geometry.boundingSphere = geometry.boundingBox.getBoundingSphere(new THREE.Sphere());
  const uniforms = { list: { value: list }, viewport: { value: new THREE.Vector2() }, linear: { value: false } };
  const material = new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3, vertexShader, fragmentShader, uniforms, transparent: true, premultipliedAlpha: true, depthWrite: false, side: THREE.DoubleSide,
  });
  const object = new THREE.Mesh(geometry, material);
  object.frustumCulled = false; // the worker leaves out Gaussians behind the camera
  object.raycast = () => {};
  const size = new THREE.Vector4();
  object.onBeforeRender = (renderer) => {
    renderer.getCurrentViewport(size);
    uniforms.viewport.value.set(size.z, size.w);
    // Colors are sRGB. Where the output is converted for the screen, it needs linear ones.
    const target = renderer.getRenderTarget();
    const space = target && !target.isXRRenderTarget ? target.texture.colorSpace : renderer.outputColorSpace;
    uniforms.linear.value = space !== THREE.SRGBColorSpace;
    material.uniformsNeedUpdate = true;
  };

  let memory = null;
  const follower = new Follower(
    ({ time, row, eye }) => scene.frame(time, { row, eye }, memory),
    (frame) => {
      // A segment of a take may have more Gaussians than the one before.
      if (frame.list.length > list.image.data.length) {
        list.dispose();
        list = uniforms.list.value = textureOf(frame.list.length / 16 / ROW);
      }
      list.image.data.set(frame.list);
      list.needsUpdate = true;
      geometry.setDrawRange(0, (6 / 16) * frame.list.length);
      memory = frame.list.buffer;
    },
  );
  const toCamera = new THREE.Matrix4();
  const update = (time, seenFrom = camera) => {
    object.updateWorldMatrix(true, false);
    seenFrom.updateWorldMatrix(true, false);
    const { elements: e } = toCamera.multiplyMatrices(seenFrom.matrixWorldInverse, object.matrixWorld);
    const row = [-e[2], -e[6], -e[10], -e[14]];
    return follower.update({ time, row, eye: new THREE.Vector3().applyMatrix4(toCamera.invert()).toArray() });
  };
  await update(0);
  return {
    object,
    update,
    get time() {
      return follower.shown.time;
    },
    dispose() {
      follower.stop();
      object.removeFromParent();
      for (const part of [list, geometry, material]) part.dispose();
    },
  };
}
