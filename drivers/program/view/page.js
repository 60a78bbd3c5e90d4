// What every page of this program does: asks for its state and for images, and draws them. A page defines learn(state),
// stateAddress(), OVER and draw().
const $ = id => document.getElementById(id);
let state = null;                     // newest answer of /state
let image = {bitmap: null, sequence: -1, width: 0, height: 0, tracks: []};
let tails = new Map();                // track id -> its last places in the image
let heardAt = 0, told = "";
let dirty = true, dirtyImage = true;   // what is to be drawn anew
const TAIL = 12;

// ---------------------------------------------------------------- conversation
const pause = ms => new Promise(done => setTimeout(done, ms));

const token = new URLSearchParams(location.search).get("token");  // beyond this computer each request shows it

async function ask(path) {
  const shown = token === null ? "" : (path.includes("?") ? "&" : "?") + "token=" + encodeURIComponent(token);
  const answer = await fetch(path + shown, {cache: "no-store", signal: AbortSignal.timeout(4000)});
  if (!answer.ok && answer.status !== 404) throw new Error("status " + answer.status);
  return answer;
}

async function followState() {
  for (;;) {
    const began = performance.now();
    let rest = document.hidden ? 1000 : 60;
    try {
      const answer = await ask(stateAddress());
      const words = await answer.text();
      if (words === told) heardAt = performance.now();  // nothing has changed, nothing is drawn
      else if (!learn(JSON.parse(words))) continue;
      told = words;
      if (state.finished) rest = 500;
    } catch (e) {
      rest = 1000;
    }
    showLink();
    await pause(Math.max(rest - (performance.now() - began), 5));
  }
}

async function followImage() {
  for (;;) {
    const began = performance.now();
    if (state && state.image && state.image - 1 !== image.sequence && !document.hidden) {
      try {
        const answer = await ask("frame");
        if (answer.status === 200) await takeFrame(await answer.arrayBuffer());
      } catch (e) { await pause(500); }
    }
    await pause(Math.max(75 - (performance.now() - began), 15));
  }
}

async function takeFrame(bytes) {
  const size = new DataView(bytes).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, size)));
  const bitmap = head.has_image ? await createImageBitmap(new Blob([new Uint8Array(bytes, 4 + size)], {type: "image/jpeg"})) : null;
  if (image.bitmap) image.bitmap.close();
  const tracks = [], seen = new Map();
  const take = (list, left, firstId) => {
    for (let i = 0; i < list.length; i += 4) {
      const id = firstId + list[i], age = list[i + 1], x = left + list[i + 2], y = list[i + 3];
      const tail = tails.get(id) || [];
      tail.push([x, y]);
      if (tail.length > TAIL) tail.shift();
      seen.set(id, tail);
      tracks.push({age, x, y, tail});
    }
  };
  take(head.tracks, 0, 0);
  head.others.forEach((other, i) => take(other.tracks, other.x, (i + 1) * 2 ** 32));  // several may see a track
  tails = seen;
  image = {bitmap, sequence: head.sequence, width: head.width, height: head.height, tracks};
  dirtyImage = true;
}

// ---------------------------------------------------------------- text
const text = (id, value) => { const e = $(id); if (e.textContent !== value) e.textContent = value; };

function element(kind, words, parent) {
  const e = document.createElement(kind);
  if (words) e.textContent = words;
  if (parent) parent.append(e);
  return e;
}

function showList(id, lines) {
  if ($(id).dataset.shown === lines.join()) return;
  $(id).dataset.shown = lines.join();
  $(id).replaceChildren(...lines.map(line => element("li", line)));
}

const fixed = (x, digits) => x === null || x === undefined ? "–" : (Math.abs(x) < 0.5 * 10 ** -digits ? 0 : x).toFixed(digits).replace("-", "−");
const clock = s => `${Math.floor(s / 60)}:${(s % 60).toFixed(1).padStart(4, "0")}`;
const norm = v => Math.hypot(...v);
const ms = x => x === null ? "–" : fixed(x, x < 10 ? 2 : x < 100 ? 1 : 0);

function showLink() {
  const silent = (performance.now() - heardAt) / 1000, page = $("page");
  const gone = state !== null && silent > 2.5, over = state !== null && state.finished;
  page.classList.toggle("live", state !== null && !gone && !over);
  page.classList.toggle("gone", gone && !over);
  page.classList.toggle("over", over);
  text("link", over ? "finished" : gone ? "connection lost" : state ? "live" : "connecting");
  $("banner").hidden = !(gone || over);
  $("banner").classList.toggle("calm", over);
  text("bannerTitle", over ? "Finished." : "Connection lost.");
  text("bannerText", over ? OVER
    : `The program has ended or cannot be reached. What you see is ${Math.round(silent)} s old; do not rely on it.`);
}

let ink = {};
function readInk() {
  const style = getComputedStyle(document.documentElement);
  for (const k of ["bg", "card", "ink", "soft", "faint", "line", "well", "c1", "c2", "c3", "c4", "good", "warn", "bad", "grey", "sky1", "sky2", "earth1", "earth2"])
    ink[k] = style.getPropertyValue("--" + k).trim();
  ink.states = [ink.grey, ink.c1, ink.warn, ink.bad];
  dirty = dirtyImage = true;
}
matchMedia("(prefers-color-scheme:dark)").addEventListener("change", readInk);

const FONT = 'system-ui,-apple-system,"Segoe UI",Roboto,"Noto Sans","DejaVu Sans",sans-serif';
/// The context of a canvas, as many pixels as it has on the screen, in CSS units.
function begin(id) {
  const canvas = $(id), ratio = Math.min(3, window.devicePixelRatio || 1), w = canvas.clientWidth, h = canvas.clientHeight;
  if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) { canvas.width = Math.round(w * ratio); canvas.height = Math.round(h * ratio); }
  const c = canvas.getContext("2d");
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  c.clearRect(0, 0, w, h);
  c.font = `11px ${FONT}`; c.lineJoin = "round"; c.lineCap = "round";
  return [c, w, h];
}

function stroke(c, points) {
  c.beginPath();
  points.forEach(([x, y], i) => i ? c.lineTo(x, y) : c.moveTo(x, y));
  c.stroke();
}

function disc(c, x, y, radius) { c.beginPath(); c.arc(x, y, radius, 0, 7); c.fill(); }

function axis(c, w, left, ticks) {
  c.textAlign = "right"; c.textBaseline = "middle"; c.fillStyle = ink.soft; c.strokeStyle = ink.line; c.lineWidth = 1;
  for (const [value, y] of ticks) {
    c.fillText(String(+value.toPrecision(3)).replace("-", "−"), left - 6, y);
    stroke(c, [[left, Math.round(y) + .5], [w, Math.round(y) + .5]]);
  }
}

// Young tracks are warm, old ones cold.
const AGES = [[0, 255, 90, 54], [5, 255, 181, 46], [15, 141, 220, 85], [40, 47, 198, 192], [100, 91, 140, 255]];
function ageColor(age) {
  let i = 1;
  while (i < AGES.length - 1 && age > AGES[i][0]) ++i;
  const a = AGES[i - 1], b = AGES[i], k = Math.max(0, Math.min(1, (age - a[0]) / (b[0] - a[0])));
  return `rgb(${[1, 2, 3].map(j => Math.round(a[j] + k * (b[j] - a[j]))).join()})`;
}

function drawCamera() {
  const shape = image.width ? `${image.width} / ${image.height}` : "25 / 16";
  if ($("camera").style.aspectRatio !== shape) $("camera").style.aspectRatio = shape;
  const [c, w, h] = begin("camera");
  let scale = image.width ? w / image.width : 1;
  if (image.bitmap) c.drawImage(image.bitmap, 0, 0, w, h);
  else if (image.tracks.length) {  // recorded tracks: no image, and no word on its size
    scale = Math.min(w / Math.max(...image.tracks.map(t => t.x + 20)), h / Math.max(...image.tracks.map(t => t.y + 20)));
  } else {
    c.fillStyle = ink.soft; c.textAlign = "center"; c.font = `13px ${FONT}`; c.fillText("no image yet", w / 2, h / 2);
    return;
  }
  const at = v => (v + .5) * scale;
  for (const t of image.tracks) {
    const style = ageColor(t.age);
    if (t.tail.length > 1)
      for (const [color, width] of [["rgba(0,0,0,.45)", 3], [style, 1.5]]) {
        c.strokeStyle = color; c.lineWidth = width;
        stroke(c, t.tail.map(([x, y]) => [at(x), at(y)]));
      }
    c.fillStyle = "rgba(0,0,0,.55)"; disc(c, at(t.x), at(t.y), 3.6);
    c.fillStyle = style; disc(c, at(t.x), at(t.y), 2.6);
  }
}

/// At the end of a page's script.
function begins() {
  new ResizeObserver(() => { dirty = dirtyImage = true; }).observe(document.body);
  setInterval(showLink, 500);
  readInk();
  followState();
  followImage();
  requestAnimationFrame(draw);
}
