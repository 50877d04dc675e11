"use strict";
// Camera, lights, grid and trails.

const centres = new Float32Array(bytes(run.centres)); // places x 3: one for all frames, or one for each
function centreAt(frame) {
  const last = centres.length / 3 - 1, i = Math.min(Math.floor(frame), last);
  const [here, next] = [i, Math.min(i + 1, last)].map((k) => new THREE.Vector3().fromArray(centres, 3 * k));
  return here.lerp(next, frame - Math.floor(frame));
}
const up = new THREE.Vector3(...run.up);

const canvas = document.getElementById("canvas");
if (!document.createElement("canvas").getContext("webgl2")) {
  document.getElementById("note").textContent = "This page needs WebGL 2, which this browser lacks or has switched off.";
}
const renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
const stage = new THREE.Scene();
const camera = new THREE.PerspectiveCamera(35, 1);
camera.up.copy(up);
const orbit = new THREE.OrbitControls(camera, canvas);
const sun = new THREE.DirectionalLight(0xffffff, 1.6);
stage.add(new THREE.HemisphereLight(0xffffff, 0x8d8d99, 1.9), sun, sun.target, ...Object.values(layers));

// What the camera follows: a body, or the mechanism where it travels; null: nothing.
function followed(body, frame) {
  if (body >= 0) return new THREE.Vector3(...placed(body, [0, 0, 0], [0, 0, 0]));
  return body === -2 ? centreAt(frame) : null;
}

function home(body, frame) {
  if (run.eye) {
    const [eye, target] = run.eye.map((point) => new THREE.Vector3(...point.map((x, i) => x - run.origin[i])));
    camera.position.copy(eye);
    orbit.target.copy(target);
  } else {
    const fitted = run.radius / Math.sin((camera.fov * Math.PI) / 360) / Math.min(1, camera.aspect);
    orbit.target.copy(followed(body, frame) || centreAt(frame));
    camera.position.copy(orbit.target).addScaledVector(new THREE.Vector3(...run.view).normalize(), fitted);
  }
  orbit.update();
}

const { step, level } = run.grid; // of its lines; height of its plane along `up`
const grid = new THREE.GridHelper(24 * step, 24, 0x888888, 0x888888);
grid.material.transparent = true;
grid.material.opacity = 0.3;
grid.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), up);
function layGrid() { // under what is looked at, lines at whole steps from the origin
  grid.position.copy(orbit.target).addScaledVector(up, level - orbit.target.dot(up));
  for (let i = 0; i < 3; i++) {
    if (Math.abs(up.getComponent(i)) > 0.5) continue;
    const at = grid.position.getComponent(i) + run.origin[i];
    grid.position.setComponent(i, step * Math.round(at / step) - run.origin[i]);
  }
}
stage.add(grid);

// Trails: the way so far of a point of a body, (3,) in its frame.
const trails = new THREE.Group(), trailOf = new Map();
stage.add(trails);
function wayOf(body, point) {
  const way = new Float32Array(3 * run.frames), x = [0, 0, 0], away = point.some((s) => s !== 0);
  for (let k = 0; k < run.frames; k++) {
    const centroid = 3 * (k * count + body);
    if (away) pose(k);
    way.set(away ? placed(body, point, x) : positions.subarray(centroid, centroid + 3), 3 * k);
  }
  return way;
}
function toggleTrail(body, point = [0, 0, 0]) {
  const key = `${body}: ${point}`;
  if (trailOf.has(key)) {
    trails.remove(trailOf.get(key));
    trailOf.delete(key);
    return;
  }
  const shape = new THREE.BufferGeometry();
  shape.setAttribute("position", new THREE.BufferAttribute(wayOf(body, point), 3));
  const colour = (run.parts.find((part) => part.body === body) || { colour: "gray" }).colour;
  const line = new THREE.Line(shape, new THREE.LineBasicMaterial({ color: colour }));
  line.frustumCulled = false;
  trails.add(line);
  trailOf.set(key, line);
}
for (const { body, point } of run.trails) toggleTrail(body, point);

// What is seen, from close by to beyond the motion.
function focus() {
  const distance = camera.position.distanceTo(orbit.target);
  camera.near = 0.01 * distance;
  camera.far = 100 * distance + 10 * run.whole;
  camera.updateProjectionMatrix();
}

function resize() {
  const width = canvas.clientWidth, height = canvas.clientHeight;
  renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
  renderer.setSize(width, height, false);
  Object.assign(names, { width: canvas.width, height: canvas.height });
  camera.aspect = width / Math.max(1, height);
}
