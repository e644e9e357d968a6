// Directions, and Hammer's equal-area projection of the whole sky seen from inside: east is left.

export const RAD = Math.PI / 180;
const HALF = Math.SQRT2; // half of the map's height; its width is twice its height

// A matrix, and its transpose, times a vector.
export function turned(matrix, vector) {
  return matrix.map((row) => dot(row, vector));
}

export function turnedBack(matrix, vector) {
  return [0, 1, 2].map((at) => matrix.reduce((sum, row, i) => sum + row[at] * vector[i], 0));
}

export function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Unit vector from longitude and latitude in degrees, and back.
export function vector(along, above) {
  const across = Math.cos(above * RAD);
  return [across * Math.cos(along * RAD), across * Math.sin(along * RAD), Math.sin(above * RAD)];
}

export function angles([x, y, z]) {
  const along = Math.atan2(y, x) / RAD;
  return [(along + 360) % 360, Math.atan2(z, Math.hypot(x, y)) / RAD];
}

// Unit vector in camera axes from the two angles of Sun and nadir sensors: components towards x and
// y of the angle from the boresight, in degrees.
export function fromParts(alpha, beta) {
  const away = Math.hypot(alpha, beta) * RAD;
  const around = Math.atan2(beta, alpha);
  return [Math.sin(away) * Math.cos(around), Math.sin(away) * Math.sin(around), Math.cos(away)];
}

// Angle between two unit vectors in degrees, precise for small ones too.
export function apart(a, b) {
  const chord = Math.hypot(...a.map((part, i) => part - b[i]));
  return (2 * Math.asin(Math.min(chord / 2, 1))) / RAD;
}

// Position on a map of half width 2 and half height 1, right and down from its middle.
export function flat([x, y, z]) {
  const along = Math.atan2(y, x);
  const across = Math.hypot(x, y);
  const size = Math.sqrt(1 + across * Math.cos(along / 2));
  return [(-2 * across * Math.sin(along / 2)) / size, -z / size];
}

// The direction at such a position; null outside of the map.
export function direction(right, down) {
  const [x, y] = [-right * HALF, -down * HALF];
  const size = 1 - (x / 4) ** 2 - (y / 2) ** 2;
  if (size < 0.5) return null;
  const z = Math.sqrt(size);
  const along = 2 * Math.atan2(z * x, 2 * (2 * z * z - 1));
  const above = Math.asin(Math.min(Math.max(z * y, -1), 1));
  return vector(along / RAD, above / RAD);
}

// Directions on a circle of `radius` degrees around another one.
export function circle(centre, radius, points = 120) {
  const least = centre.map(Math.abs).indexOf(Math.min(...centre.map(Math.abs)));
  const one = unit(cross(centre, [0, 1, 2].map((at) => Number(at === least))));
  const two = cross(centre, one);
  const [c, s] = [Math.cos(radius * RAD), Math.sin(radius * RAD)];
  return Array.from({ length: points + 1 }, (_, step) => {
    const turn = (2 * Math.PI * step) / points;
    return centre.map((part, i) => c * part + s * (Math.cos(turn) * one[i] + Math.sin(turn) * two[i]));
  });
}

function unit(v) {
  const size = Math.hypot(...v);
  return v.map((part) => part / size);
}

export function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}
