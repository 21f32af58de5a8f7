"use strict";
// Draws start shapes on a film (mark), and shows finished tracks (view).  Coordinates are pixels of
// the film; pixel (0, 0) is the square [0, 1) x [0, 1).  Names are shown as text, never as HTML.

const $ = (id) => document.getElementById(id);
const NEAR = 8, HANDLE = 5, ROW = 22, DOUBTFUL = 0.8, UNCONFIRMED = 5;
let about, frame = 0, view = { scale: 0, x: 0, y: 0 };
let items = [], selected = null, past = [], drawing = true, drag = null, joint = null, wanted = null;
let results = [], hidden = new Set(), playing = null, busy = false;
const pictures = new Map();

// --- talking to the server ---

async function ask(name, content = {}) {
  const body = JSON.stringify(content);
  const answer = await fetch(name, {
    method: "POST", headers: { "Content-Type": "application/json" }, body,
    keepalive: body.length < 60000, // also while the page is closed; browsers allow 64 KiB
  });
  const result = await answer.json();
  if (!answer.ok) throw Object.assign(new Error(result.error), result, { status: answer.status });
  return result;
}

function say(text, wrong = false) {
  $("status").textContent = text;
  $("status").className = wrong ? "wrong" : "";
}

// Ask which of the answers is meant; "" if the question is dismissed.
function choose(question, ...answers) {
  const dialog = $("choice");
  return new Promise((resolve) => {
    dialog.replaceChildren(element("p", { textContent: question }), ...answers.map((answer) =>
      element("button", { textContent: answer, onclick: () => dialog.close(answer) })));
    dialog.returnValue = "";
    dialog.onclose = () => resolve(dialog.returnValue);
    dialog.showModal();
  });
}

// --- the film ---

function picture(number) {
  if (!pictures.has(number)) {
    const image = new Image();
    image.onload = () => { if (number === frame) redraw(); };
    image.onerror = () => { if (number === frame) say(`There is no frame ${number}.`, true); };
    image.src = `frame/${number}`;
    pictures.set(number, image);
    if (pictures.size > 300) pictures.delete(pictures.keys().next().value);
  }
  return pictures.get(number);
}

function go(number) {
  frame = Math.max(0, Math.min(Math.round(number) || 0, Number($("slider").max)));
  $("slider").value = $("number").value = frame;
  $("time").textContent = `${(frame / about.fps).toFixed(2)} s`;
  redraw();
  list();
}

function canvases() { return [...document.querySelectorAll("#pictures canvas")]; }

function fit() {
  const canvas = canvases()[0];
  const scale = Math.min(canvas.clientWidth / about.width, canvas.clientHeight / about.height);
  view = {
    scale, x: (canvas.clientWidth - scale * about.width) / 2,
    y: (canvas.clientHeight - scale * about.height) / 2,
  };
  redraw();
}

function place(event) {
  const bounds = event.target.getBoundingClientRect();
  return [(event.clientX - bounds.left - view.x) / view.scale,
    (event.clientY - bounds.top - view.y) / view.scale].map((v) => Math.round(10 * v) / 10);
}

function redraw() {
  const image = picture(frame);
  canvases().forEach((canvas, index) => {
    const dense = window.devicePixelRatio || 1;
    canvas.width = canvas.clientWidth * dense;
    canvas.height = canvas.clientHeight * dense;
    const pen = canvas.getContext("2d");
    pen.setTransform(dense * view.scale, 0, 0, dense * view.scale, dense * view.x, dense * view.y);
    pen.imageSmoothingEnabled = view.scale < 3;
    if (image.complete && image.naturalWidth) pen.drawImage(image, 0, 0, about.width, about.height);
    pen.lineWidth = 2 / view.scale;
    pen.font = `${13 / view.scale}px system-ui, sans-serif`;
    if (results[index]) results[index].rows.get(frame)?.forEach((row) => drawRow(pen, results[index], row));
    if (index === 0) items.filter((item) => item.frame === frame).forEach((item) => drawItem(pen, item));
  });
  canvases().forEach((canvas) => { canvas.dataset.shown = image.complete ? frame : ""; });
  for (const ahead of [1, 2, 3]) if (frame + ahead <= Number($("slider").max)) picture(frame + ahead);
  drawTimeline();
}

// --- drawing shapes ---

function colourOf(name) {
  let index = about.names.indexOf(String(name));
  if (index < 0) index = about.names.push(String(name)) - 1;
  return about.colours[index % about.colours.length];
}

function label(pen, text, x, y, colour) {
  const size = 13 / view.scale, width = pen.measureText(text).width + size / 2;
  pen.fillStyle = colour;
  pen.fillRect(x, y - 1.3 * size, width, 1.3 * size);
  pen.fillStyle = "#000";
  pen.fillText(text, x + size / 4, y - 0.3 * size);
}

function path(pen, points, closed) {
  pen.beginPath();
  points.forEach(([x, y], index) => (index ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  if (closed) pen.closePath();
}

// A smooth curve through points (Catmull and Rom's).
function smooth(points, closed) {
  const count = points.length, at = (i) => points[closed ? (i + count) % count : Math.max(0, Math.min(count - 1, i))];
  if (count < 3) return points;
  const line = [];
  for (let i = 0; i < (closed ? count : count - 1); i++) {
    const [a, b, c, d] = [at(i - 1), at(i), at(i + 1), at(i + 2)];
    for (let step = 0; step < 12; step++) {
      const t = step / 12;
      line.push([0, 1].map((k) => 0.5 * (2 * b[k] + (c[k] - a[k]) * t
        + (2 * a[k] - 5 * b[k] + 4 * c[k] - d[k]) * t * t + (3 * b[k] - a[k] - 3 * c[k] + d[k]) * t ** 3)));
    }
  }
  return closed ? line : [...line, points[count - 1]];
}

function rectangle(x, y, w, h, angle) {
  const cos = Math.cos(angle), sin = Math.sin(angle);
  return [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([i, j]) =>
    [x + (i * w * cos - j * h * sin) / 2, y + (i * w * sin + j * h * cos) / 2]);
}

function outline(item) {
  if (item.kind === "boxes") return rectangle(item.x + item.w / 2, item.y + item.h / 2, item.w, item.h, 0);
  if (item.kind === "parts") {
    const length = Math.hypot(item.x2 - item.x1, item.y2 - item.y1);
    return rectangle((item.x1 + item.x2) / 2, (item.y1 + item.y2) / 2, length, item.width,
      Math.atan2(item.y2 - item.y1, item.x2 - item.x1));
  }
  return smooth(item.points, item.closed);
}

function handles(item) {
  if (item.kind === "boxes") return [[item.x, item.y], [item.x + item.w, item.y], [item.x + item.w, item.y + item.h], [item.x, item.y + item.h]];
  if (item.kind === "points") return [[item.x, item.y]];
  if (item.kind === "parts") return [[item.x1, item.y1], [item.x2, item.y2]];
  return item.points;
}

function setHandle(item, index, [x, y]) {
  if (item.kind === "boxes") {
    const [ox, oy] = handles(item)[(index + 2) % 4];
    Object.assign(item, { x: Math.min(x, ox), y: Math.min(y, oy), w: Math.abs(x - ox), h: Math.abs(y - oy) });
    return handles(item).findIndex(([hx, hy]) => hx === x && hy === y);
  }
  if (item.kind === "points") Object.assign(item, { x, y });
  if (item.kind === "contours") item.points[index] = [x, y];
  if (item.kind === "parts") {
    // A joint belongs to all parts that meet there.
    const [ox, oy] = handles(item)[index];
    for (const other of items.filter((i) => i.kind === "parts" && i.frame === item.frame)) {
      if (other.x1 === ox && other.y1 === oy) Object.assign(other, { x1: x, y1: y });
      if (other.x2 === ox && other.y2 === oy) Object.assign(other, { x2: x, y2: y });
    }
  }
  return index;
}

function shift(item, dx, dy) {
  for (const key of ["x", "x1", "x2"]) if (key in item) item[key] += dx;
  for (const key of ["y", "y1", "y2"]) if (key in item) item[key] += dy;
  if (item.points) item.points = item.points.map(([x, y]) => [x + dx, y + dy]);
}

function drawItem(pen, item) {
  if (item.kind !== $("kind").value) return;
  const colour = colourOf(item.name), size = HANDLE / view.scale;
  pen.strokeStyle = pen.fillStyle = colour;
  if (item.kind === "points") {
    pen.beginPath();
    pen.arc(item.x, item.y, size, 0, 7);
    pen.fill();
  } else {
    path(pen, outline(item), item.kind !== "contours" || item.closed);
    pen.stroke();
  }
  if (item === selected || item.kind === "parts") {
    for (const [x, y] of handles(item)) pen.fillRect(x - size / 2, y - size / 2, size, size);
  }
  const [x, y] = handles(item)[0];
  label(pen, item.name, x, y - size, colour);
}

function drawRow(pen, result, row) {
  if (hidden.has(row.id)) return;
  const colour = colourOf(row.id), x = row.x, y = row.y;
  pen.strokeStyle = pen.fillStyle = colour;
  pen.globalAlpha = row.lost ? 0.5 : 1;
  pen.setLineDash(row.lost ? [6 / view.scale, 6 / view.scale] : []);
  const line = result.outlines.get(`${frame}/${row.id}`);
  if (line) path(pen, line, false);
  else if ("angle" in row) path(pen, rectangle(x, y, row.w, row.h, row.angle * Math.PI / 180), true);
  else if ("w" in row) path(pen, rectangle(x + row.w / 2, y + row.h / 2, row.w, row.h, 0), true);
  else { pen.beginPath(); pen.arc(x, y, HANDLE / view.scale, 0, 7); }
  if (line || "w" in row || row.lost) pen.stroke(); else pen.fill();
  const at = "centre_x_2.5" in row ? "centre_" : "";
  if ($("intervals").checked && Number.isFinite(row[`${at}x_2.5`])) {
    const [left, right, top, bottom] = ["x_2.5", "x_97.5", "y_2.5", "y_97.5"].map((name) => row[at + name]);
    pen.beginPath();
    pen.ellipse((left + right) / 2, (top + bottom) / 2, (right - left) / 2, (bottom - top) / 2, 0, 0, 7);
    pen.setLineDash([2 / view.scale, 3 / view.scale]);
    pen.stroke();
  }
  pen.setLineDash([]);
  const said = Number.isFinite(row.confidence) ? ` ${row.confidence.toFixed(2)}` : "";
  label(pen, `${row.id}${row.doubtful && !row.lost ? " ?" : ""}${said}${row.lost ? " lost" : ""}`, x, y - 4 / view.scale, colour);
  pen.globalAlpha = 1;
}

// --- marking ---

const mine = () => items.filter((item) => item.kind === $("kind").value);
const here = () => mine().filter((item) => item.frame === frame);

function remember() {
  past.push(JSON.stringify(items));
  if (past.length > 200) past.shift();
}

let soon = null, unsaved = null, writing = Promise.resolve();
function changed() {
  redraw();
  list();
  clearTimeout(soon);
  unsaved = $("kind").value;
  soon = setTimeout(save, 300); // what is drawn is saved as it is drawn
}

function save() {
  clearTimeout(soon);
  const kind = unsaved || $("kind").value;
  unsaved = null;
  writing = writing.then(() => write(kind)); // one after the other
  return writing;
}

async function write(kind) {
  try {
    const shapes = items.filter((item) => item.kind === kind);
    const done = await ask("save", { kind, items: shapes, digest: about.digests[kind] });
    about.digests[kind] = done.digest;
    say(done.file ? `Saved ${done.file}\n${done.command}` : "Nothing is drawn yet.");
    $("track").hidden = !about.can_track || !done.file;
    return done;
  } catch (error) {
    say(error.message, true);
    if (!("digest" in error)) return null;
    const [theirs, ours] = ["Load the file", "Replace it by this page"];
    const choice = error.status === 409 ? await choose(error.message, theirs, ours) : null;
    if (choice !== "") about.digests[kind] = error.digest;
    if (choice === ours) return write(kind);
    if (choice === theirs) {
      remember();
      items = [...items.filter((item) => item.kind !== kind), ...error.items];
      selected = joint = null;
      redraw();
      list();
      say("The file is loaded; Undo brings back what was here.");
    }
    return null;
  }
}

function newName() {
  const names = new Set(mine().map((item) => item.name));
  // An object of another frame that is not yet in this one is drawn again: a correction.
  if (selected && selected.kind === $("kind").value && selected.frame !== frame
    && !here().some((item) => item.name === selected.name)) return selected.name;
  if (wanted && wanted.frame === frame && !here().some((item) => item.name === wanted.name)) return wanted.name;
  for (let number = 1; ; number++) if (!names.has(String(number))) return String(number);
}

function added(item) {
  remember();
  const name = newName();
  items.push({ kind: $("kind").value, name, frame, ...item });
  selected = items[items.length - 1];
  return selected;
}

function nearest(at) {
  const found = here().flatMap((item) => handles(item).map((handle, index) =>
    ({ item, index, far: Math.hypot(handle[0] - at[0], handle[1] - at[1]) })));
  found.sort((a, b) => a.far - b.far || (b.item === selected) - (a.item === selected));
  return found.length && found[0].far * view.scale <= NEAR ? found[0] : null;
}

function inside(item, [x, y]) {
  if (item.kind === "points") return false;
  const corners = outline(item);
  return corners.reduce((odd, [ax, ay], i) => {
    const [bx, by] = corners[(i + 1) % corners.length];
    return (ay > y) !== (by > y) && x < ax + (bx - ax) * (y - ay) / (by - ay) ? !odd : odd;
  }, false);
}

function press(event) {
  event.target.setPointerCapture(event.pointerId);
  const at = place(event), kind = $("kind").value;
  const pan = { what: "pan", from: [event.clientX, event.clientY], view: { ...view } };
  if (event.button || event.shiftKey || event.target !== canvases()[0]) { drag = pan; return; }
  const grabbed = nearest(at), under = here().find((item) => inside(item, at));
  if (grabbed && !(drawing && kind === "parts")) {
    remember();
    selected = grabbed.item;
    drag = { what: "handle", ...grabbed };
  } else if (!drawing) {
    selected = under || null;
    if (under) { remember(); drag = { what: "shift", item: under, at }; } else drag = pan;
  } else if (kind === "boxes") {
    const item = added({ x: at[0], y: at[1], w: 0, h: 0 });
    drag = { what: "handle", item, index: 2 };
  } else if (kind === "points") {
    drag = { what: "handle", item: added({ x: at[0], y: at[1] }), index: 0 };
  } else if (kind === "contours") {
    const isOpen = selected && selected.kind === kind && selected.frame === frame && !selected.done;
    if (isOpen) { remember(); selected.points.push(at); } else {
      added({ closed: $("closed").checked, width: $("closed").checked ? null : Number($("width").value), points: [at] });
    }
    drag = { what: "handle", item: selected, index: selected.points.length - 1 };
  } else {
    const end = grabbed ? handles(grabbed.item)[grabbed.index] : at;
    if (joint && !grabbed) {
      const ends = (item) => [[item.x2, item.y2], [item.x1, item.y1]].map((e) => e.join());
      const above = here().find((item) => ends(item)[0] === joint.join()) || here().find((item) => ends(item)[1] === joint.join());
      added({ x1: joint[0], y1: joint[1], x2: end[0], y2: end[1], width: Number($("width").value), parent: above ? above.name : "" });
    }
    joint = end;
  }
  changed();
}

function move(event) {
  if (!drag) return;
  const at = place(event);
  if (drag.what === "pan") {
    view = { ...drag.view, x: drag.view.x + event.clientX - drag.from[0], y: drag.view.y + event.clientY - drag.from[1] };
    redraw();
  } else {
    if (drag.what === "handle") drag.index = setHandle(drag.item, drag.index, at);
    else { shift(drag.item, at[0] - drag.at[0], at[1] - drag.at[1]); drag.at = at; }
    changed();
  }
}

function release() {
  if (drag && drag.item && (drag.item.w < 2 || drag.item.h < 2)) undo();
  drag = null;
}

function undo() {
  if (!past.length) return;
  items = JSON.parse(past.pop());
  selected = joint = null;
  changed();
}

function remove(item) {
  remember();
  items = items.filter((other) => other !== item);
  for (const other of items) if (other.kind === "parts" && other.parent === item.name) other.parent = item.parent;
  selected = joint = null;
  changed();
}

function add() {
  const [x, y] = [about.width / 2, about.height / 2], size = Math.round(Math.min(x, y) / 4), kind = $("kind").value;
  if (kind === "boxes") added({ x: x - size, y: y - size, w: 2 * size, h: 2 * size });
  else if (kind === "points") added({ x, y });
  else if (kind === "parts") added({ x1: x - size, y1: y, x2: x + size, y2: y, width: Number($("width").value), parent: "" });
  else {
    added({ closed: true, width: null, points: [0, 1, 2, 3, 4, 5].map((i) => [x + size * Math.cos(i * Math.PI / 3), y + size * Math.sin(i * Math.PI / 3)]) });
    selected.done = true;
  }
  changed();
}

// --- the list of objects ---

function element(tag, properties, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

function list() {
  if ($("objects").contains(document.activeElement) && document.activeElement.tagName === "INPUT" && document.activeElement.type !== "checkbox") return;
  $("objects").replaceChildren(...objectsOf().map(viewRow), ...mine().map(markRow));
}

function markRow(item) {
  const name = element("input", { type: "text", value: item.name, ariaLabel: "Name" });
  name.onchange = () => {
    const wanted = name.value.trim(), taken = here().some((other) => other !== item && other.name === wanted);
    if (!wanted || taken) { say(taken ? `'${wanted}' is taken.` : "Give it a name.", true); name.value = item.name; return; }
    remember();
    for (const other of items) if (other.parent === item.name) other.parent = wanted;
    item.name = wanted;
    name.blur();
    changed();
  };
  const row = element("li", { className: item === selected ? "selected" : "" }, name,
    element("button", { textContent: `frame ${item.frame}`, onclick: () => { selected = item; go(item.frame); } }),
    element("button", { textContent: "Delete", ariaLabel: `Delete ${item.name}`, onclick: () => remove(item) }));
  if (item === selected) {
    for (const key of ["x", "y", "w", "h", "x1", "y1", "x2", "y2", "width"].filter((k) => typeof item[k] === "number")) {
      const field = element("input", { type: "number", step: "any", value: item[key], ariaLabel: `${key} of ${item.name}` });
      field.onchange = () => { remember(); item[key] = Number(field.value); field.blur(); changed(); };
      row.append(element("label", {}, `${key} `, field));
    }
    if (item.kind === "parts") row.append(element("span", { textContent: item.parent ? `on ${item.parent}` : "root" }));
  }
  row.style.borderColor = colourOf(item.name);
  return row;
}

function objectsOf() { return results.length ? [...results[0].objects.keys()] : []; }

function viewRow(name) {
  const shown = element("input", { type: "checkbox", checked: !hidden.has(name), ariaLabel: `Show ${name}` });
  shown.onchange = () => { hidden[shown.checked ? "delete" : "add"](name); redraw(); };
  const lost = results[0].objects.get(name).filter((row) => row.lost).length;
  const row = element("li", {}, element("label", {}, shown, ` ${name}`), element("span", { textContent: lost ? `lost in ${lost} frame${lost > 1 ? "s" : ""}` : "" }));
  row.style.borderColor = colourOf(name);
  return row;
}

// --- results ---

function parse(text) {
  // CSV with quoted fields; every line is whole.
  const rows = [];
  let row = [], field = "", quoted = false;
  for (let i = 0; i < text.length; i++) {
    const c = text[i];
    if (quoted) { if (c === '"' && text[i + 1] === '"') { field += c; i++; } else if (c === '"') quoted = false; else field += c; }
    else if (c === '"') quoted = true;
    else if (c === ",") { row.push(field); field = ""; }
    else if (c === "\n") { rows.push([...row, field]); row = []; field = ""; }
    else if (c !== "\r") field += c;
  }
  return rows;
}

function emptyResult(name) {
  return { name, rows: new Map(), objects: new Map(), outlines: new Map(), at: { file: 0, tracks: 0, outlines: 0 }, header: null, left: new Map() };
}

async function read(index) {
  const answer = await ask("result", { index, at: results[index].at });
  if (answer.is_new) results[index] = emptyResult(results[index].name);
  const result = results[index];
  result.at = answer.at;
  for (const fields of parse(answer.tracks)) {
    if (!result.header) { result.header = fields; continue; }
    const row = {};
    result.header.forEach((key, i) => { row[key] = key === "id" ? fields[i].replace(/^'(?='*[=+\-@])/, "") : fields[i] === "" ? NaN : Number(fields[i]); });
    const left = row.lost ? UNCONFIRMED : Math.max((result.left.get(row.id) || 0) - 1, 0);
    result.left.set(row.id, left);
    row.doubtful = Boolean(row.lost) || left > 0 || row.confidence < DOUBTFUL;
    if (!result.rows.has(row.frame)) result.rows.set(row.frame, []);
    if (!result.objects.has(row.id)) result.objects.set(row.id, []);
    result.rows.get(row.frame).push(row);
    result.objects.get(row.id).push(row);
  }
  for (const [number, name, , x, y, kind] of parse(answer.outlines)) {
    if (kind !== "outline") continue;
    const key = `${Number(number)}/${name}`;
    if (!result.outlines.has(key)) result.outlines.set(key, []);
    result.outlines.get(key).push([Number(x), Number(y)]);
  }
  if (answer.tracks) { redraw(); list(); }
  return answer;
}

function showResults(names) {
  results = names.map(emptyResult);
  $("pictures").replaceChildren(...(names.length ? names : [""]).map((name) => {
    const canvas = element("canvas", { tabIndex: 0, ariaLabel: "The film with its shapes", onpointerdown: press, onpointermove: move, onpointerup: release, onwheel: wheel });
    return element("figure", {}, ...(names.length > 1 ? [element("figcaption", { textContent: name })] : []), canvas);
  }));
  $("timeline").hidden = $("view-tools").hidden = !names.length;
  fit();
}

async function follow() {
  // Read results until the run that writes them has ended.
  if (busy) return;
  busy = true;
  let was = false;
  try {
    for (;;) {
      let running = false;
      for (let index = 0; index < results.length; index++) running = (await read(index)).running || running;
      const progress = await ask("progress");
      const last = Math.max(...results[0].rows.keys());
      if (progress.running) { was = true; say(`Tracking into ${results[0].name}: ${last > 0 ? `frame ${last}` : "compiling, which takes up to a minute"}`); }
      else if (progress.text) say(progress.text, progress.failed);
      else if (was) say(`The run into ${results[0].name} has ended.`);
      if (!running && !progress.running) break;
      await new Promise((resolve) => setTimeout(resolve, 500));
    }
  } catch (error) { say(error.message, true); } finally { busy = false; }
}

async function track(replaces = false) {
  if (!(await save())) return;
  try {
    const kind = $("kind").value;
    const started = await ask("track", { kind, items: mine(), digest: about.digests[kind], replaces });
    say(`Tracking into ${started.output} ...`);
    showResults([started.output]);
    await follow();
  } catch (error) {
    say(error.message, true);
    const yes = "Replace the results";
    if (error.status === 409 && await choose(error.message, yes, "Cancel") === yes) await track(true);
  }
}

function doubtful(step) {
  const frames = [...results[0].rows.entries()].filter(([, rows]) => rows.some((row) => row.doubtful && !hidden.has(row.id))).map(([number]) => number).sort((a, b) => step * (a - b));
  const found = frames.find((number) => step * (number - frame) > 0);
  if (found === undefined) { say(step > 0 ? "No doubtful frame follows." : "No doubtful frame before this one."); return; }
  const rows = results[0].rows.get(found).filter((row) => row.doubtful && !hidden.has(row.id));
  say(rows.map((row) => `${row.id} is ${row.lost ? "lost" : "doubtful"} in frame ${found}.`).join("  "));
  selected = null;
  wanted = { frame: found, name: rows[0].id }; // what is drawn here corrects it
  go(found);
}

function drawTimeline() {
  const canvas = $("timeline"), names = objectsOf();
  if (canvas.hidden || !names.length) return;
  const last = Math.max(Number($("slider").max), 1), dense = window.devicePixelRatio || 1;
  canvas.style.height = `${ROW * names.length}px`;
  canvas.width = canvas.clientWidth * dense;
  canvas.height = ROW * names.length * dense;
  const pen = canvas.getContext("2d"), step = canvas.clientWidth / (last + 1);
  pen.scale(dense, dense);
  names.forEach((name, index) => {
    const bottom = ROW * (index + 1) - 2, high = ROW - 4;
    for (const row of results[0].objects.get(name)) {
      const x = step * row.frame;
      if (row.doubtful) { pen.fillStyle = row.lost ? "#88888899" : "#e6a70066"; pen.fillRect(x, bottom - high, Math.max(step, 1), high); }
      const level = Number.isFinite(row.confidence) ? row.confidence : 1;
      pen.fillStyle = colourOf(name);
      pen.fillRect(x, bottom - high * level, Math.max(step, 1), 2);
    }
  });
  pen.fillStyle = "#c0392b";
  pen.fillRect(step * frame, 0, 2, canvas.clientHeight);
}

// --- events ---

function wheel(event) {
  event.preventDefault();
  const bounds = event.target.getBoundingClientRect(), x = event.clientX - bounds.left, y = event.clientY - bounds.top;
  const factor = Math.exp(-event.deltaY / 500);
  view = { scale: view.scale * factor, x: x - (x - view.x) * factor, y: y - (y - view.y) * factor };
  redraw();
}

function play() {
  clearInterval(playing);
  playing = playing ? null : setInterval(() => (frame < Number($("slider").max) ? go(frame + 1) : play()), 1000 / about.fps);
  $("play").textContent = playing ? "Stop" : "Play";
}

function kindChanged() {
  if (unsaved) save();
  const kind = $("kind").value;
  selected = joint = null;
  $("closed-label").hidden = kind !== "contours";
  $("width-label").hidden = kind !== "parts" && kind !== "contours";
  $("hint").textContent = {
    boxes: "Drag a box around each object.",
    points: "Click on each point, then type its name.",
    parts: "Click from joint to joint; click on a joint to continue from it, Escape to begin anew.",
    contours: "Click along the outline; Enter ends a contour.",
  }[kind] + "  Shift and drag, or the middle button, moves the picture.  A shape in a later frame starts or corrects the object whose name it has in the list (boxes and points).";
  redraw();
  list();
}

function key(event) {
  if ($("choice").open) return;
  if (["INPUT", "SELECT"].includes(event.target.tagName) && event.target.type !== "range" && event.target.type !== "checkbox") return;
  const keys = {
    ArrowLeft: () => go(frame - (event.shiftKey ? 10 : 1)), ArrowRight: () => go(frame + (event.shiftKey ? 10 : 1)),
    Home: () => go(0), End: () => go(Infinity), " ": play, 0: fit,
    Delete: () => selected && remove(selected), Backspace: () => selected && remove(selected),
    Enter: () => { if (selected) selected.done = true; selected = joint = null; changed(); },
    Escape: () => { if (selected) selected.done = true; selected = joint = null; changed(); },
    d: () => $("tool").click(), n: () => results.length && doubtful(1), p: () => results.length && doubtful(-1),
  };
  if ((event.ctrlKey || event.metaKey) && event.key === "z") undo();
  else if (event.target.tagName === "BUTTON" && ["Enter", " "].includes(event.key)) return;
  else if (event.key in keys && !event.ctrlKey && !event.metaKey) keys[event.key]();
  else return;
  event.preventDefault();
}

async function start() {
  const answer = await fetch("about");
  about = await answer.json();
  if (!answer.ok) throw new Error(about.error);
  about.names = [];
  document.title = $("title").textContent = about.name;
  $("slider").max = about.frames - 1;
  $("number").max = about.frames - 1;
  items = about.items;
  $("kind").value = about.kind;
  $("mark-tools").hidden = !about.can_draw;
  document.addEventListener("keydown", key);
  window.addEventListener("resize", fit);
  $("slider").oninput = () => go(Number($("slider").value));
  $("number").onchange = () => go(Number($("number").value));
  $("tool").onclick = () => { drawing = !drawing; $("tool").textContent = drawing ? "Draw" : "Move"; $("tool").setAttribute("aria-pressed", drawing); };
  Object.assign($("undo"), { onclick: undo });
  $("add").onclick = add; $("save").onclick = save; $("track").onclick = () => track(); $("fit").onclick = fit; $("play").onclick = play;
  $("next").onclick = () => doubtful(1); $("previous").onclick = () => doubtful(-1);
  $("intervals").onchange = redraw;
  $("timeline").onclick = (event) => go(event.offsetX / $("timeline").clientWidth * (Number($("slider").max) + 1) - 0.5);
  showResults(about.results);
  items.forEach((item) => colourOf(item.name));
  if (about.can_draw) { $("kind").onchange = kindChanged; kindChanged(); }
  go(about.start);
  new EventSource("alive");
  window.addEventListener("pagehide", () => unsaved && save());
  if (about.note) say(about.note, true);
  if (results.length) follow();
}

start().catch((error) => say(error.message, true));
