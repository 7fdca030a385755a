// The numbers of the page: base64 of unsigned integers, and of real numbers rounded to 16 bits (see pack.rs).

function bytesOf(text) {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let k = 0; k < bytes.length; k++) bytes[k] = letters.charCodeAt(k);
  return bytes;
}
const integersOf = (text) => new Uint32Array(bytesOf(text).buffer);

// The code of a missing number, and the number that the shaders draw in gray.
const MISSING_CODE = 65535;
const MISSING = 1e30;

function unpack({ low, high, data }) {
  const codes = new Uint16Array(bytesOf(data).buffer);
  const numbers = new Float32Array(codes.length);
  const count = low.length;
  for (let k = 0; k < codes.length; k++) {
    const c = k % count;
    numbers[k] = codes[k] === MISSING_CODE ? MISSING : low[c] + ((high[c] - low[c]) * codes[k]) / (MISSING_CODE - 1);
  }
  return numbers;
}

// The normals of triangles, as long as twice their areas.
function normalsOf(points, triangles) {
  const normals = new Float64Array(triangles.length);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [3 * triangles[t], 3 * triangles[t + 1], 3 * triangles[t + 2]];
    const bx = points[b] - points[a], by = points[b + 1] - points[a + 1], bz = points[b + 2] - points[a + 2];
    const cx = points[c] - points[a], cy = points[c + 1] - points[a + 1], cz = points[c + 2] - points[a + 2];
    normals[t] = by * cz - bz * cy;
    normals[t + 1] = bz * cx - bx * cz;
    normals[t + 2] = bx * cy - by * cx;
  }
  return normals;
}

// Joins two lists of numbers.
function joined(first, second) {
  const all = new Float32Array(first.length + second.length);
  all.set(first);
  all.set(second, first.length);
  return all;
}

// Three significant digits, as in the tables of the page.
function digits(value) {
  if (Math.abs(value) >= MISSING / 2 || !Number.isFinite(value)) return "\u2013";
  if (value === 0) return "0";
  const size = Math.abs(value);
  return size >= 1e-4 && size < 1e6
    ? value.toFixed(Math.min(7, Math.max(0, 2 - Math.floor(Math.log10(size) + 1e-9))))
    : value.toExponential(2);
}

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const normalized = (a) => scale(a, 1 / Math.max(Math.hypot(...a), 1e-300));
const at = (numbers, k) => [numbers[3 * k], numbers[3 * k + 1], numbers[3 * k + 2]];
