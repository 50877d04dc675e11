"use strict";
// The run: arrays from base64, and poses of all bodies at a frame, as 4 x 4 matrices by columns.

const run = JSON.parse(document.getElementById("run").textContent);
const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
const positions = new Float32Array(bytes(run.positions)); // frames x bodies x 3
const rotations = new Int16Array(bytes(run.rotations)); // frames x bodies x (x, y, z, w)
const loads = new Int16Array(bytes(run.loads)); // arrows x frames x 3
const count = run.bodies.length;
const poses = new Float32Array(16 * (count + 1)); // the last one is the ground's
poses.set([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -run.origin[0], -run.origin[1], -run.origin[2], 1], 16 * count);
const poseOf = (body) => 16 * (body < 0 ? count : body);

// Poses at a frame, a number that needs not be whole: linear between frames, Euler parameters scaled to unit length.
function pose(frame) {
  const first = Math.min(Math.floor(frame), run.frames - 1), w = frame - first;
  const next = Math.min(first + 1, run.frames - 1);
  for (let b = 0; b < count; b++) {
    const p = 3 * (first * count + b), pn = 3 * (next * count + b);
    const r = 4 * (first * count + b), rn = 4 * (next * count + b), at = 16 * b;
    const dot = rotations[r] * rotations[rn] + rotations[r + 1] * rotations[rn + 1]
      + rotations[r + 2] * rotations[rn + 2] + rotations[r + 3] * rotations[rn + 3];
    const u = 1 - w, v = dot < 0 ? -w : w;
    let x = u * rotations[r] + v * rotations[rn], y = u * rotations[r + 1] + v * rotations[rn + 1];
    let z = u * rotations[r + 2] + v * rotations[rn + 2], e = u * rotations[r + 3] + v * rotations[rn + 3];
    const s = 1 / Math.sqrt(x * x + y * y + z * z + e * e);
    x *= s; y *= s; z *= s; e *= s;
    poses[at] = 1 - 2 * (y * y + z * z); poses[at + 1] = 2 * (x * y + e * z); poses[at + 2] = 2 * (x * z - e * y);
    poses[at + 4] = 2 * (x * y - e * z); poses[at + 5] = 1 - 2 * (x * x + z * z); poses[at + 6] = 2 * (y * z + e * x);
    poses[at + 8] = 2 * (x * z + e * y); poses[at + 9] = 2 * (y * z - e * x); poses[at + 10] = 1 - 2 * (x * x + y * y);
    for (let i = 0; i < 3; i++) poses[at + 12 + i] = (1 - w) * positions[p + i] + w * positions[pn + i];
    poses[at + 15] = 1;
  }
}

// A point of a body, (3,) in its frame, where the body is now.
function placed(body, point, out) {
  const at = poseOf(body);
  for (let i = 0; i < 3; i++) {
    out[i] = poses[at + 12 + i] + poses[at + i] * point[0] + poses[at + 4 + i] * point[1] + poses[at + 8 + i] * point[2];
  }
  return out;
}

// A load at a frame, as a part of the largest one of its unit.
function loadAt(arrow, frame, out) {
  const first = Math.min(Math.floor(frame), run.frames - 1), w = frame - first;
  const at = 3 * (arrow * run.frames + first), next = 3 * (arrow * run.frames + Math.min(first + 1, run.frames - 1));
  for (let i = 0; i < 3; i++) out[i] = ((1 - w) * loads[at + i] + w * loads[next + i]) / 32767;
  return out;
}
