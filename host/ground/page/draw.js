// Shapes on canvases that several parts draw.

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
