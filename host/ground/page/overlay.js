// What was found in a picture, drawn over it: places with their names, and lines.

const RADIUS = 9; // all lengths in pixels of the screen
const EDGE = 4; // of a mark whose name many others have too
const MANY = 3;
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
  const times = new Map();
  for (const { name } of marks) times.set(name, (times.get(name) ?? 0) + 1);
  const often = ({ name }) => name && times.get(name) >= MANY;
  for (const mark of marks) {
    const { x, y, name } = mark;
    pen.strokeStyle = name ? KNOWN : UNKNOWN;
    pen.setLineDash(name ? [] : [3, 3]);
    pen.beginPath();
    pen.arc(...place(x, y), often(mark) ? EDGE : RADIUS, 0, 2 * Math.PI);
    pen.stroke();
  }
  const named = marks.filter((mark) => mark.name && !often(mark));
  const circles = marks.map((mark) => place(mark.x, mark.y));
  return write(pen, named, circles, place, size, magnitudes);
}

function write(pen, marks, circles, place, size, magnitudes) {
  const faint = (mark) => mark.v_mag ?? Infinity;
  const taken = [];
  let left = 0;
  pen.fillStyle = KNOWN;
  for (const mark of marks.sort((a, b) => faint(a) - faint(b))) {
    const [x, y] = place(mark.x, mark.y);
    if (x < 0 || y < 0 || x > size.width || y > size.height) continue;
    const text = words(mark, magnitudes);
    const wide = pen.measureText(text).width;
    const aside = RADIUS + GAP;
    const top = Math.min(Math.max(y - TEXT / 2, 0), size.height - TEXT);
    const free = [x + aside, x - aside - wide]
      .map((from) => ({ left: from, top, wide }))
      .filter((box) => box.left >= 0 && box.left + wide <= size.width)
      .filter((box) => !taken.some((other) => meet(box, other)));
    const box = free.find((one) => !circles.some((circle) => under(one, circle))) ?? free[0];
    if (!box) {
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

function under({ left, top, wide }, [x, y]) {
  const across = x > left - RADIUS && x < left + wide + RADIUS;
  return across && y > top - RADIUS && y < top + TEXT + RADIUS;
}

function meet(a, b) {
  const across = a.left < b.left + b.wide && b.left < a.left + a.wide;
  return across && Math.abs(a.top - b.top) < TEXT;
}
