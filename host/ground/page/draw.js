// Shapes on canvases that several parts draw, and detections over an image: marks and lines.

const RADIUS = 9; // all lengths in CSS pixels
const EDGE = 4; // radius of marks that share a name, such as points of an edge
export const MANY = 3; // marks with the same name, which is not drawn then
const TEXT = 12;
const GAP = 3;

const IDENTIFIED = "#78ff78";
const UNIDENTIFIED = "#ff8c5a";
const LINE = "#78aaff";
const HALO = "#000c"; // keeps marks and names visible on a bright image

export function line(pen, [fromX, fromY], [toX, toY]) {
  pen.beginPath();
  pen.moveTo(fromX, fromY);
  pen.lineTo(toX, toY);
  pen.stroke();
}

export function disc(pen, [x, y], radius) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fill();
}

export function ring(pen, [x, y], radius) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.stroke();
}

// A pen in CSS pixels on a canvas with the pixels of the screen, so that text stays sharp.
export function sharpPen(canvas, width, height) {
  const scale = window.devicePixelRatio || 1;
  canvas.width = width * scale;
  canvas.height = height * scale;
  const pen = canvas.getContext("2d");
  pen.scale(scale, scale);
  return pen;
}

// Whether two lines of text, each with `left`, `top` and `wide`, are closer than `gap`.
export function overlap(a, b, high, gap = 0) {
  const across = a.left < b.left + b.wide + gap && b.left < a.left + a.wide + gap;
  return across && Math.abs(a.top - b.top) < high;
}

// Draws detections over an image: marks with their names, and lines.
// `place` maps a column and row of the image to the screen. Returns the number of names without
// room; names of bright stars have priority.
export function drawDetections(pen, { marks, lines }, place, size, magnitudes) {
  pen.clearRect(0, 0, size.width, size.height);
  pen.font = `${TEXT}px system-ui, sans-serif`;
  pen.textBaseline = "middle";
  pen.lineJoin = "round";
  pen.setLineDash([]);
  for (const line of lines) {
    pen.beginPath();
    for (const [x, y] of line) pen.lineTo(...place(x, y));
    pen.closePath();
    haloed(pen, LINE);
  }
  const counts = new Map();
  for (const { name } of marks) counts.set(name, (counts.get(name) ?? 0) + 1);
  const isCommon = ({ name }) => name && counts.get(name) >= MANY;
  for (const mark of marks) {
    const { x, y, name } = mark;
    pen.setLineDash(name ? [] : [3, 3]);
    const [column, row] = place(x, y);
    pen.beginPath();
    pen.arc(column, row, isCommon(mark) ? EDGE : RADIUS, 0, 2 * Math.PI);
    haloed(pen, name ? IDENTIFIED : UNIDENTIFIED);
  }
  const named = marks.filter((mark) => mark.name && !isCommon(mark));
  const circles = marks.map((mark) => place(mark.x, mark.y));
  return drawNames(pen, named, circles, place, size, magnitudes);
}

function haloed(pen, colour) {
  pen.lineWidth = 4;
  pen.strokeStyle = HALO;
  pen.stroke();
  pen.lineWidth = 1.5;
  pen.strokeStyle = colour;
  pen.stroke();
}

function drawNames(pen, marks, circles, place, size, magnitudes) {
  const faint = (mark) => mark.v_mag ?? Infinity;
  const taken = [];
  let hidden = 0;
  pen.fillStyle = IDENTIFIED;
  for (const mark of marks.sort((a, b) => faint(a) - faint(b))) {
    const [x, y] = place(mark.x, mark.y);
    if (x < 0 || y < 0 || x > size.width || y > size.height) continue;
    const text = label(mark, magnitudes);
    const wide = pen.measureText(text).width;
    const aside = RADIUS + GAP;
    const top = Math.min(Math.max(y - TEXT / 2, 0), size.height - TEXT);
    const free = [x + aside, x - aside - wide]
      .map((from) => ({ left: from, top, wide }))
      .filter((box) => box.left >= 0 && box.left + wide <= size.width)
      .filter((box) => !taken.some((other) => overlap(box, other, TEXT)));
    const box = free.find((one) => !circles.some((circle) => covers(one, circle))) ?? free[0];
    if (!box) {
      hidden += 1;
      continue;
    }
    taken.push(box);
    pen.setLineDash([]);
    pen.lineWidth = 3;
    pen.strokeStyle = HALO;
    pen.strokeText(text, box.left, box.top + TEXT / 2);
    pen.fillText(text, box.left, box.top + TEXT / 2);
  }
  return hidden;
}

function label({ name, v_mag }, magnitudes) {
  return magnitudes && v_mag !== null ? `${name} ${v_mag.toFixed(1)}` : name;
}

function covers({ left, top, wide }, [x, y]) {
  const across = x > left - RADIUS && x < left + wide + RADIUS;
  return across && y > top - RADIUS && y < top + TEXT + RADIUS;
}
