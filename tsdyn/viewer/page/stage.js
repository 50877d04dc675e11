"use strict";
// Camera, lights, grid and trails.

const extent = (() => { // of the motion: centre and radius of a ball about it
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (let k = 0; k < positions.length; k++) {
    const reach = run.bulk[Math.floor(k / 3) % count];
    low[k % 3] = Math.min(low[k % 3], positions[k] - reach);
    high[k % 3] = Math.max(high[k % 3], positions[k] + reach);
  }
  const centre = new THREE.Vector3(...low.map((x, i) => 0.5 * (x + high[i])));
  const size = high.map((x, i) => x - low[i]);
  return { low, high, centre, radius: 0.5 * Math.hypot(...size) };
})();
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

function home() {
  orbit.target.copy(extent.centre);
  const narrow = Math.min(1, camera.aspect);
  const distance = extent.radius / Math.sin((camera.fov * Math.PI) / 360) / narrow;
  camera.position.copy(extent.centre).addScaledVector(new THREE.Vector3(...run.view).normalize(), 0.9 * distance);
  orbit.update();
}

const step = (() => { // of the grid: 1, 2 or 5 times a power of ten
  const wide = extent.radius / 4, power = 10 ** Math.floor(Math.log10(wide));
  return power * (wide >= 5 * power ? 5 : wide >= 2 * power ? 2 : 1);
})();
const grid = new THREE.GridHelper(24 * step, 24, 0x888888, 0x888888);
grid.material.transparent = true;
grid.material.opacity = 0.3;
grid.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), up);
{
  // below the motion, or through the origin where that is not far below
  const heights = extent.low.map((x, i) => (up.getComponent(i) > 0 ? x : -extent.high[i]) * Math.abs(up.getComponent(i)));
  const lowest = heights.reduce((sum, x) => sum + x, 0);
  const zero = -run.origin.reduce((sum, x, i) => sum + x * up.getComponent(i), 0);
  const height = zero <= lowest && lowest - zero < 2 * extent.radius ? zero : lowest;
  const level = extent.centre.clone().addScaledVector(up, height - extent.centre.dot(up));
  for (let i = 0; i < 3; i++) { // lines at whole steps from the origin
    if (Math.abs(up.getComponent(i)) > 0.5) continue;
    const at = level.getComponent(i) + run.origin[i];
    level.setComponent(i, step * Math.round(at / step) - run.origin[i]);
  }
  grid.position.copy(level);
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
  camera.far = 100 * distance + 10 * extent.radius;
  camera.updateProjectionMatrix();
}

function resize() {
  const width = canvas.clientWidth, height = canvas.clientHeight;
  renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
  renderer.setSize(width, height, false);
  camera.aspect = width / Math.max(1, height);
}
