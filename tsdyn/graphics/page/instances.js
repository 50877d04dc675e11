"use strict";
// Everything solid is an instance of a few unit shapes: one mesh for each layer and shape, a matrix for each instance.

const faded = 0.72; // brightness of every other sector of balls and cylinders, which shows that they spin

// The faces of a shape of revolution about z, painted by sectors.
function painted(geometry, bands) {
  const shape = geometry.index ? geometry.toNonIndexed() : geometry, place = shape.getAttribute("position");
  const colours = new Float32Array(3 * place.count);
  for (let i = 0; i < place.count; i += 3) {
    let x = 0, y = 0, z = 0;
    for (let j = i; j < i + 3; j++) { x += place.getX(j); y += place.getY(j); z += place.getZ(j); }
    const dark = bands && (x > 0) ^ (y > 0) ^ (bands > 1 && z > 0);
    colours.fill(dark ? faded : 1, 3 * i, 3 * i + 9);
  }
  shape.setAttribute("color", new THREE.BufferAttribute(colours, 3));
  return shape;
}

class Helix extends THREE.Curve {
  getPoint(t) {
    const angle = 16 * Math.PI * t;
    return new THREE.Vector3(Math.cos(angle), Math.sin(angle), t - 0.5);
  }
}

// A coil; its wire is flat, since springs are stretched far along z.
function coil() {
  const rings = 200, wire = new THREE.TubeGeometry(new Helix(), rings, 0.14, 5), place = wire.getAttribute("position");
  for (let i = 0; i < place.count; i++) {
    const middle = Math.floor(i / 6) / rings - 0.5;
    place.setZ(i, middle + 0.12 * (place.getZ(i) - middle));
  }
  wire.computeVertexNormals();
  return wire;
}

function meshOf(data) {
  const shape = new THREE.BufferGeometry();
  shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array(bytes(data.vertices)), 3));
  shape.setIndex(new THREE.BufferAttribute(new Uint32Array(bytes(data.faces)), 1));
  const flat = shape.toNonIndexed();
  flat.computeVertexNormals();
  return flat;
}

const sides = run.bodies.length < 200 ? 24 : 8; // of balls and cylinders
const upright = (geometry) => geometry.rotateX(Math.PI / 2); // from y, the axis of three.js, to z
const shapes = {
  box: () => painted(new THREE.BoxGeometry(1, 1, 1), 0),
  sphere: () => painted(upright(new THREE.SphereGeometry(1, sides, (2 * sides) / 3)), 2),
  cylinder: () => painted(upright(new THREE.CylinderGeometry(1, 1, 1, sides)), 1),
  cone: () => painted(upright(new THREE.ConeGeometry(1, 1, 16)), 0),
  coil: () => painted(coil(), 0),
};
run.meshes.forEach((data, i) => { shapes[`mesh${i}`] = () => painted(meshOf(data), 0); });

const layers = {};
for (const name of ["bodies", "joints", "frames", "reactions", "forces"]) layers[name] = new THREE.Group();

// Meshes with room for the instances of a list: {layer, kind, colour, ...}; each gets its mesh and its place in it.
function instantiate(list) {
  const groups = new Map();
  for (const one of list) {
    const key = `${one.layer} ${one.kind}`;
    groups.set(key, groups.get(key) || []);
    groups.get(key).push(one);
  }
  for (const members of groups.values()) {
    const { layer, kind } = members[0];
    const solid = layer === "bodies" || layer === "joints"; // all else is drawn over them
    const material = new THREE.MeshLambertMaterial({ vertexColors: true, depthTest: solid });
    if (kind.startsWith("mesh")) material.side = THREE.DoubleSide;
    const mesh = new THREE.InstancedMesh(shapes[kind](), material, members.length);
    mesh.renderOrder = solid ? 0 : 1;
    mesh.frustumCulled = false;
    mesh.instanceMatrix.setUsage(THREE.DynamicDrawUsage);
    mesh.owners = members;
    members.forEach((one, i) => {
      one.mesh = mesh;
      one.place = 16 * i;
      mesh.instanceMatrix.array[16 * i + 15] = 1;
      mesh.setColorAt(i, new THREE.Color(one.colour));
    });
    layers[layer].add(mesh);
  }
}

// A part follows its body: its matrix is the pose times the part's own, twelve numbers by columns.
function follow(part) {
  const at = poseOf(part.body), out = part.mesh.instanceMatrix.array, m = part.matrix;
  for (let c = 0; c < 4; c++) {
    for (let i = 0; i < 3; i++) {
      out[part.place + 4 * c + i] = poses[at + i] * m[3 * c] + poses[at + 4 + i] * m[3 * c + 1]
        + poses[at + 8 + i] * m[3 * c + 2] + (c === 3 ? poses[at + 12 + i] : 0);
    }
  }
}

// A unit shape along z from p to q, (3,) each; a part of zero length vanishes.
function stretch(one, p, q, radius) {
  const out = one.mesh.instanceMatrix.array, at = one.place;
  const d = [q[0] - p[0], q[1] - p[1], q[2] - p[2]], length = Math.hypot(d[0], d[1], d[2]) || 1e-30;
  const sizes = d.map(Math.abs), least = sizes.indexOf(Math.min(...sizes)), e = [0, 0, 0];
  e[least] = 1;
  const x = cross(e, d), f = radius / (Math.hypot(x[0], x[1], x[2]) || 1), y = cross(d, x);
  for (let i = 0; i < 3; i++) {
    out[at + i] = f * x[i];
    out[at + 4 + i] = (f / length) * y[i];
    out[at + 8 + i] = d[i];
    out[at + 12 + i] = 0.5 * (p[i] + q[i]);
  }
}

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
