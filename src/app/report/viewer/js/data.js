// The numbers of the page: base64 of unsigned integers, and of real numbers rounded to 16 bits (see pack.rs).

const bytesOf = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
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
