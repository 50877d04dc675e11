"use strict";
// Names of bodies and joints, drawn over the stage; pictures and films of both.

const names = document.getElementById("names"), pen = names.getContext("2d");
const lineHeight = 1.3; // of a line of text, per size of its letters
const crowd = 300; // names, above which they may cover each other

function drawNames(bodies, joints) {
  const ratio = renderer.getPixelRatio(), letters = 12 * ratio, x = [0, 0, 0];
  pen.clearRect(0, 0, names.width, names.height);
  pen.font = `${letters}px system-ui, sans-serif`;
  pen.textAlign = "center";
  pen.lineWidth = 3 * ratio;
  pen.lineJoin = "round";
  const { color, backgroundColor } = getComputedStyle(document.body), line = lineHeight * letters;
  const taken = []; // [left, right, height] of lines that are there
  const below = (left, right, y) => { // the first free place under that of a line
    const other = taken.find((one) => left < one[1] && right > one[0] && Math.abs(y - one[2]) < 0.99 * line);
    return other ? below(left, right, other[2] + line) : y;
  };
  for (const { text, layer, body, point, violated } of run.labels) {
    if (!violated && !(layer === "bodies" ? bodies : joints)) continue;
    const at = new THREE.Vector3(...placed(body, point, x)).project(camera);
    if (Math.abs(at.z) > 1) continue; // behind the camera
    pen.strokeStyle = backgroundColor;
    pen.fillStyle = violated ? "#d33a2c" : color;
    const middle = 0.5 * (1 + at.x) * names.width;
    let y = 0.5 * (1 - at.y) * names.height;
    for (const words of text.split("\n")) {
      const half = 0.5 * pen.measureText(words).width;
      if (run.labels.length < crowd) y = below(middle - half, middle + half, y);
      taken.push([middle - half, middle + half, y]);
      pen.strokeText(words, middle, y);
      pen.globalAlpha = layer === "bodies" || violated ? 1 : 0.7;
      pen.fillText(words, middle, y);
      pen.globalAlpha = 1;
      y += line;
    }
  }
}

function save(address, suffix) {
  Object.assign(document.createElement("a"), { href: address, download: `tsdyn.${suffix}` }).click();
}

// The stage and the names as one canvas, with the background of the page or without.
const film = document.createElement("canvas");
function compose(background) {
  if (film.width !== canvas.width || film.height !== canvas.height) Object.assign(film, { width: canvas.width, height: canvas.height });
  const brush = film.getContext("2d");
  brush.clearRect(0, 0, film.width, film.height);
  if (background) {
    brush.fillStyle = getComputedStyle(document.body).backgroundColor;
    brush.fillRect(0, 0, film.width, film.height);
  }
  brush.drawImage(canvas, 0, 0);
  brush.drawImage(names, 0, 0);
  return film;
}

// A film of the page as it plays; browsers without WebM record MP4.
const formats = ["video/webm;codecs=vp9", "video/webm", "video/mp4"];
const format = window.MediaRecorder ? formats.find((one) => MediaRecorder.isTypeSupported(one)) : undefined;
let recorder = null;
function startFilm(finished) {
  const parts = [];
  recorder = new MediaRecorder(compose(true).captureStream(), { mimeType: format, videoBitsPerSecond: 1e7 });
  recorder.ondataavailable = (event) => parts.push(event.data);
  recorder.onstop = () => {
    recorder = null;
    finished(new Blob(parts, { type: format }));
  };
  recorder.start();
}
function stopFilm() { // it ends a moment later
  if (recorder && recorder.state === "recording") recorder.stop();
}
