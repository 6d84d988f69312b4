// Pixels: from the page's text to linear radiance, and from there to the colours of a canvas.

const constants = JSON.parse(document.getElementById('report-constants').textContent);
const NOT_FINITE = [0, 229, 255];
const clamp = (value, low, high) => Math.max(low, Math.min(high, value));

const decoded = new Map();

/** Bytes of a payload of the page, decompressed. */
async function bytesOf(name) {
  const text = atob(document.getElementById(name).textContent);
  const bytes = Uint8Array.from(text, (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Decode once, however many viewers show it. */
function decodeOnce(name, decode) {
  if (!decoded.has(name)) decoded.set(name, bytesOf(name).then(decode));
  return decoded.get(name);
}

/** The number that each of the 65536 half floats stands for. */
const halves = (() => {
  const table = new Float32Array(65536);
  for (let code = 0; code < 65536; code++) {
    const exponent = (code >> 10) & 31;
    const mantissa = code & 1023;
    const size = exponent === 31 ? (mantissa ? NaN : Infinity)
      : exponent ? (1 + mantissa / 1024) * 2 ** (exponent - 15) : mantissa * 2 ** -24;
    table[code] = code >> 15 ? -size : size;
  }
  return table;
})();

/** Undo encode.py: zigzag, differences along a row, differences from green. Interleaved RGB, times `scale`. */
function unpackPixels(bytes, width, height, scale) {
  const count = width * height;
  const planes = new Uint16Array(3 * count);
  for (let i = 0, code = 0; i < 3 * count; i++) {
    const folded = bytes[i] | (bytes[3 * count + i] << 8);
    const step = (folded >>> 1) ^ -(folded & 1);
    code = i % width ? code + step : step;
    planes[i] = code;
  }
  const pixels = new Float32Array(3 * count);
  for (let i = 0; i < count; i++) {
    const green = planes[i];
    pixels[3 * i] = halves[(planes[count + i] + green) & 65535] * scale;
    pixels[3 * i + 1] = halves[green] * scale;
    pixels[3 * i + 2] = halves[(planes[2 * count + i] + green) & 65535] * scale;
  }
  return pixels;
}

const COLOUR_STEPS = 512;  // even, so that zero has the colour in the middle

/** A colour map as a table, from a few anchors in hexadecimal. */
function colourTable(anchors) {
  const colours = anchors.split(' ').map((hex) => [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16)));
  return Array.from({ length: COLOUR_STEPS + 1 }, (_, i) => {
    const place = (i / COLOUR_STEPS) * (colours.length - 1);
    const k = Math.min(Math.floor(place), colours.length - 2);
    return colours[k].map((a, channel) => Math.round(a + (place - k) * (colours[k + 1][channel] - a)));
  });
}

const magma = colourTable(constants.magma);
const signed = colourTable(constants.signed);

const SRGB_STEPS = 1 << 15;  // fine enough that the steep start of the curve is exact to a level
const srgb = Uint8ClampedArray.from({ length: SRGB_STEPS + 1 }, (_, i) => {
  const linear = i / SRGB_STEPS;
  return Math.floor(255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055) + 0.5);
});

function luminanceAt(pixels, i) {
  const [r, g, b] = constants.luminance;
  return r * pixels[i] + g * pixels[i + 1] + b * pixels[i + 2];
}

const brought = (value) => (value > 0 ? Math.min(value, 1e6) : 0);  // NaN becomes 0, too

/** As stratalux.image.tonemap does it: exposure, Reinhard's extended operator on luminance, sRGB. */
function tonemap(pixels, exposure, out) {
  const gain = 2 ** exposure;
  const [lr, lg, lb] = constants.luminance;
  for (let i = 0, o = 0; i < pixels.length; i += 3, o += 4) {
    const r = brought(pixels[i] * gain), g = brought(pixels[i + 1] * gain), b = brought(pixels[i + 2] * gain);
    const luminance = lr * r + lg * g + lb * b;
    const factor = 1.18 * SRGB_STEPS * (1 + luminance / 256) / (1 + luminance);
    out[o] = srgb[Math.min(SRGB_STEPS, r * factor + 0.5) | 0];
    out[o + 1] = srgb[Math.min(SRGB_STEPS, g * factor + 0.5) | 0];
    out[o + 2] = srgb[Math.min(SRGB_STEPS, b * factor + 0.5) | 0];
    out[o + 3] = 255;
  }
}

/** Colour of each of `count` values, of which `at` gives a number in [0, 1]. */
function colourMap(count, at, table, out) {
  for (let i = 0; i < count; i++) {
    const value = at(i);
    const colour = Number.isFinite(value) ? table[Math.round(COLOUR_STEPS * clamp(value, 0, 1))] : NOT_FINITE;
    out[4 * i] = colour[0];
    out[4 * i + 1] = colour[1];
    out[4 * i + 2] = colour[2];
    out[4 * i + 3] = 255;
  }
}

/** Mean over the channels of |I − R|, of pixel `i`. */
function absoluteError(pixels, truth, i) {
  const k = 3 * i;
  return (Math.abs(pixels[k] - truth[k]) + Math.abs(pixels[k + 1] - truth[k + 1])
    + Math.abs(pixels[k + 2] - truth[k + 2])) / 3;
}

/** (I − R) / √(R² + ε) of the luminance of pixel `i`: squared, what the relative MSE is the mean of. */
function relativeError(pixels, truth, i) {
  const reference = luminanceAt(truth, 3 * i);
  return (luminanceAt(pixels, 3 * i) - reference) / Math.sqrt(reference * reference + constants.epsilon);
}

/** Three significant digits. */
function digits(value) {
  if (!Number.isFinite(value) || value === 0) return String(Math.abs(value) || value);
  const size = Math.abs(value);
  const text = size < 1e-3 || size >= 1e5 ? size.toExponential(1).replace('e-', 'e−').replace('e+', 'e')
    : size.toFixed(Math.max(0, 2 - Math.floor(Math.log10(size))));
  return value < 0 ? `−${text}` : text;
}
