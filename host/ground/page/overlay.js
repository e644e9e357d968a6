// What was found in a picture, drawn over it: places with their names, and lines.

const RADIUS = 9; // all lengths in pixels of the screen
const EDGE = 4; // of a mark whose name all others have too
const TEXT = 12;
const GAP = 3;

const KNOWN = "#78ff78";
const UNKNOWN = "#ff8c5a";
const LINE = "#78aaff";

// `place` gives the column and row on the screen of those of a picture. Returns how many names
// had no room; the brightest stars get theirs first.
export function drawFound(pen, { marks, lines }, place, size, magnitudes) {
  pen.clearRect(0, 0, size.width, size.height);
  pen.font = `${TEXT}px system-ui, sans-serif`;
  pen.textBaseline = "middle";
  pen.lineWidth = 1.5;
  pen.strokeStyle = LINE;
  pen.setLineDash([]);
  for (const line of lines) {
    pen.beginPath();
    for (const [x, y] of line) pen.lineTo(...place(x, y));
    pen.closePath();
    pen.stroke();
  }
  const often = marks.length > 1 && new Set(marks.map((mark) => mark.name)).size < 2;
  for (const { x, y, name } of marks) {
    pen.strokeStyle = name ? KNOWN : UNKNOWN;
    pen.setLineDash(name ? [] : [3, 3]);
    pen.beginPath();
    pen.arc(...place(x, y), often && name ? EDGE : RADIUS, 0, 2 * Math.PI);
    pen.stroke();
  }
  return often ? 0 : write(pen, marks, place, size, magnitudes);
}

function write(pen, marks, place, size, magnitudes) {
  const faint = (mark) => mark.v_mag ?? Infinity;
  const taken = [];
  let left = 0;
  pen.fillStyle = KNOWN;
  for (const mark of marks.filter((one) => one.name).sort((a, b) => faint(a) - faint(b))) {
    const [x, y] = place(mark.x, mark.y);
    if (x < 0 || y < 0 || x > size.width || y > size.height) continue;
    const text = words(mark, magnitudes);
    const wide = pen.measureText(text).width;
    const aside = RADIUS + GAP;
    const box = {
      left: x + aside + wide <= size.width ? x + aside : x - aside - wide,
      top: Math.min(Math.max(y - TEXT / 2, 0), size.height - TEXT),
      wide,
    };
    if (taken.some((other) => meet(box, other))) {
      left += 1;
      continue;
    }
    taken.push(box);
    pen.fillText(text, box.left, box.top + TEXT / 2);
  }
  return left;
}

function words({ name, v_mag }, magnitudes) {
  return magnitudes && v_mag !== null ? `${name} ${v_mag.toFixed(1)}` : name;
}

function meet(a, b) {
  const across = a.left < b.left + b.wide && b.left < a.left + a.wide;
  return across && Math.abs(a.top - b.top) < TEXT;
}
