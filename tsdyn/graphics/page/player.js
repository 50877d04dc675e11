"use strict";
// What moves at each frame, the controls, and the loop.

const field = (id) => document.getElementById(id);
const duration = run.time[1] - run.time[0];
const typical = [...run.reach].sort((a, b) => a - b)[run.reach.length >> 1];

// Axes of the ground and of every rigid body, and arrows of loads, as instances.
const axes = [];
[{ rigid: true }, ...run.bodies].forEach((body, i) => {
  const length = i ? 0.6 * run.reach[i - 1] : typical;
  if (!body.rigid) return;
  ["#d33a2c", "#2f9e44", "#2b6cd4"].forEach((colour, k) => {
    const size = [0.02, 0.02, 0.02].map((x) => x * length), place = [0, 0, 0];
    place[k] = 0.5 * length;
    size[k] = length;
    axes.push({ layer: "frames", kind: "box", colour, body: i - 1, matrix: [size[0], 0, 0, 0, size[1], 0, 0, 0, size[2], ...place] });
  });
});
const parts = [...run.parts, ...axes];
const colours = { reactions: { force: "#d55e00", torque: "#cc79a7" }, forces: { force: "#009e73", torque: "#56b4e9" } };
const arrows = run.arrows.map((arrow, index) => {
  const colour = arrow.unique ? colours[arrow.layer][arrow.unit] : "#888888";
  return { ...arrow, index, shaft: { layer: arrow.layer, kind: "cylinder", colour }, head: { layer: arrow.layer, kind: "cone", colour } };
});
instantiate([...parts, ...run.links, ...arrows.flatMap((arrow) => [arrow.shaft, arrow.head])]);

const contacts = parts.filter((part) => part.contact in run.contacts).map((part) => ({ ...part, shown: -1, states: new Uint8Array(bytes(run.contacts[part.contact])) }));
const ofContact = run.tones.map((colour) => new THREE.Color(colour));
const said = run.said && new Uint16Array(bytes(run.said.of));

let frame = 0, playing = run.frames > 1, before = null, scriptTime = 0;
let seen = null; // where what the camera follows was at the last frame
const showNames = field("show-names");
const p = [0, 0, 0], q = [0, 0, 0], load = [0, 0, 0];

function drawArrow(arrow, longest) {
  placed(arrow.body, arrow.point, p);
  loadAt(arrow.index, frame, load);
  const length = longest * Math.hypot(load[0], load[1], load[2]);
  const radius = Math.min(0.018 * longest, 0.1 * length), neck = Math.max(0, 1 - (6 * radius) / (length || 1));
  const tip = [0, 1, 2].map((i) => p[i] + longest * load[i]);
  for (let i = 0; i < 3; i++) q[i] = p[i] + neck * longest * load[i];
  stretch(arrow.shaft, p, q, radius);
  stretch(arrow.head, q, tip, 2.4 * radius);
}

function drawContact(contact) {
  const state = contact.states[Math.floor(frame)];
  if (state === contact.shown) return;
  contact.shown = state;
  contact.mesh.setColorAt(contact.place / 16, ofContact[state]);
  contact.mesh.instanceColor.needsUpdate = true;
}

function draw() {
  pose(frame);
  contacts.forEach(drawContact);
  if (said) field("closed").textContent = run.said.words[said[Math.floor(frame)]];
  for (const part of parts) if (layers[part.layer].visible) follow(part);
  for (const link of run.links) stretch(link, placed(link.a, link.point_a, p), placed(link.b, link.point_b, q), link.radius);
  const longest = 0.5 * run.radius * 2 ** field("scale").value;
  for (const arrow of arrows) if (layers[arrow.layer].visible) drawArrow(arrow, longest);
  for (const layer of Object.values(layers)) for (const mesh of layer.children) mesh.instanceMatrix.needsUpdate = true;
  for (const line of trailOf.values()) line.geometry.setDrawRange(0, Math.floor(frame) + 1);
  const target = followed(Number(field("follow").value), frame);
  if (target && seen) for (const point of [orbit.target, camera.position]) point.add(target).sub(seen);
  seen = target;
  orbit.update();
  focus();
  layGrid();
  sun.position.copy(camera.position);
  sun.target.position.copy(orbit.target);
  renderer.render(stage, camera);
  drawNames(showNames.checked && layers.bodies.visible, showNames.checked && layers.joints.visible);
  if (recorder) compose(true);
}

function tick(now) {
  const start = performance.now();
  if (playing && before !== null && duration > 0) {
    frame += ((now - before) / 1000) * Number(field("speed").value) * ((run.frames - 1) / duration);
    if (frame > run.frames - 1) {
      stopFilm();
      frame %= run.frames - 1;
    }
  }
  before = now;
  draw();
  field("time").value = frame / Math.max(1, run.frames - 1);
  const t = run.time[0] + (duration * frame) / Math.max(1, run.frames - 1);
  field("clock").textContent = `${t.toFixed(Math.max(0, Math.min(9, 3 - Math.floor(Math.log10(duration || 1)))))} s`;
  scriptTime = performance.now() - start;
  requestAnimationFrame(tick);
}

function setPlaying(on) {
  playing = on && run.frames > 1;
  field("play").textContent = playing ? "❚❚" : "▶";
}

function labels() {
  field("title").textContent = run.title;
  field("method").textContent = `${run.method}; tsdyn ${run.version}`;
  field("note").textContent = run.note;
  const largest = Object.entries(run.scales).filter(([, x]) => x > 0).map(([unit, x]) => `${x.toPrecision(3)} ${unit === "force" ? "N" : "N m"}`);
  field("legend").textContent = `grid ${Number(step.toPrecision(1))} m${largest.length ? `\nlongest arrows ${largest.join(", ")}` : ""}`
    + (run.arrows.every((arrow) => arrow.unique) ? "" : "\ngrey: reactions that are not unique")
    + (contacts.length ? "\ncontacts: green pushes, blue sticks, red holds back, yellow is hit" : "");
  const usual = duration >= 1.5 && duration <= 60 ? 1 : Number((duration / 10).toPrecision(1)) || 1;
  for (const factor of [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10]) {
    const rate = Number((factor * usual).toPrecision(2));
    field("speed").add(new Option(`${rate} ×`, rate, factor === 1, factor === 1));
  }
  if (centres.length > 3) field("follow").add(new Option("the mechanism", -2));
  run.bodies.forEach((body, i) => { if (!body.hidden) field("follow").add(new Option(body.name, i)); });
}

function reset() { // the camera to its first place
  field("follow").value = run.follow;
  home(run.follow, frame);
  seen = followed(run.follow, frame);
}

function pick(event) { // a click on a body names it and toggles its trail
  const box = canvas.getBoundingClientRect();
  const at = new THREE.Vector2((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
  const ray = new THREE.Raycaster();
  ray.setFromCamera(at, camera);
  for (const mesh of layers.bodies.children) mesh.boundingSphere = null; // instances have moved
  const hit = ray.intersectObjects(layers.bodies.children)[0];
  const body = hit ? hit.object.owners[hit.instanceId].body : -1;
  field("picked").hidden = !hit;
  if (!hit) return;
  field("picked").textContent = body < 0 ? "ground" : run.bodies[body].name;
  if (body >= 0) toggleTrail(body);
}

field("play").onclick = () => setPlaying(!playing);
field("time").oninput = () => { setPlaying(false); frame = field("time").value * (run.frames - 1); };
field("home").onclick = reset;
field("follow").onchange = () => { // from where a body that is small in the whole motion is seen
  const body = Number(field("follow").value), target = followed(body, frame);
  if (!target) return;
  const away = camera.position.clone().sub(orbit.target);
  if (body >= 0) away.setLength(Math.min(away.length(), 12 * run.bulk[body]));
  orbit.target.copy(target);
  camera.position.copy(orbit.target).add(away);
  seen = target;
};
field("scale").parentElement.hidden = !arrows.length;
field("picture").onclick = () => save(compose(false).toDataURL(), "png");
document.body.classList.toggle("still", run.frames < 2);
field("record").hidden = !format;
field("record").onclick = () => {
  if (recorder) { stopFilm(); return; }
  frame = 0;
  setPlaying(true);
  draw();
  startFilm((video) => {
    field("record").classList.remove("on");
    save(URL.createObjectURL(video), format.includes("mp4") ? "mp4" : "webm");
  });
  field("record").classList.add("on");
};
for (const [name, group] of Object.entries({ ...layers, trails, grid })) {
  const box = field(`show-${name}`);
  (box.onchange = () => { group.visible = box.checked; })();
  box.parentElement.hidden = !(group.children.length || name === "grid" || name === "trails");
}
let pressed = null;
canvas.onpointerdown = (event) => { pressed = [event.clientX, event.clientY]; };
canvas.onpointerup = (event) => {
  if (pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 4) pick(event);
};
document.onkeydown = (event) => {
  if (event.target.matches("input[type=range], select")) return;
  const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (event.key === " ") { setPlaying(!playing); event.preventDefault(); }
  if (event.key === "Home") field("home").click();
  if (by) { setPlaying(false); frame = Math.max(0, Math.min(run.frames - 1, Math.round(frame) + by)); }
};
labels();
setPlaying(playing);
new ResizeObserver(resize).observe(canvas);
resize();
pose(0);
reset();
requestAnimationFrame(tick);
window.tsdyn = { seek: (time) => { setPlaying(false); frame = ((time - run.time[0]) / (duration || 1)) * (run.frames - 1); }, milliseconds: () => scriptTime };
