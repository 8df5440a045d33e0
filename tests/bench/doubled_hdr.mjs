// A Radiance HDR map of twice the width and height, every texel cut into four: a map of the size
// that people use, from one of the size that tests keep.

// The header's text up to its empty line, the resolution string, and where pixels begin.
function readHeader(bytes) {
  const blank = bytes.indexOf("\n\n") + 2;
  const end = bytes.indexOf("\n", blank) + 1;
  const [, height, width] = /^-Y (\d+) \+X (\d+)\n$/.exec(bytes.toString("latin1", blank, end));
  return { text: bytes.toString("latin1", 0, blank), width: Number(width), height: Number(height), end };
}

// One channel of a scan line of the run-length encoding: counts above 128 repeat the next byte.
function readRuns(bytes, at, line) {
  for (let x = 0; x < line.length; ) {
    const count = bytes[at++];
    if (count > 128) line.fill(bytes[at++], x, (x += count - 128));
    else for (let i = 0; i < count; i += 1) line[x++] = bytes[at++];
  }
  return at;
}

export function doubledHdr(bytes) {
  const { text, width, height, end } = readHeader(bytes);
  const wide = 2 * width;
  const pieces = [Buffer.from(`${text}-Y ${2 * height} +X ${wide}\n`, "latin1")];
  const line = new Uint8Array(width);
  let at = end;
  for (let y = 0; y < height; y += 1) {
    if (bytes[at] !== 2 || bytes[at + 1] !== 2) throw new Error(`scan line ${y} is not run-length encoded`);
    at += 4;
    const row = [Buffer.from([2, 2, wide >> 8, wide & 255])];
    for (let channel = 0; channel < 4; channel += 1) {
      at = readRuns(bytes, at, line);
      for (let x = 0; x < width; x += 64) {
        const part = line.subarray(x, x + 64);
        row.push(Buffer.from([2 * part.length, ...Array.from(part).flatMap((value) => [value, value])]));
      }
    }
    pieces.push(...row, ...row);
  }
  return Buffer.concat(pieces);
}
