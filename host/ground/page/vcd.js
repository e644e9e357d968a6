// Reader of VCD files.

const UNITS = { s: 1, ms: 1e-3, us: 1e-6, ns: 1e-9, ps: 1e-12 };

// Variables of the scope `within`: name, bits, and changes [time in s, value].
export function readVcd(text, within) {
  const variables = new Map();
  const scopes = [];
  let unit = 1e-9;
  let time = 0;
  for (const line of text.split("\n")) {
    const words = line.trim().split(/\s+/);
    if (words[0] === "$timescale") unit = Number(words[1]) * UNITS[words[2]];
    else if (words[0] === "$scope") scopes.push(words[2]);
    else if (words[0] === "$upscope") scopes.pop();
    else if (words[0] === "$var" && scopes.at(-1) === within)
      variables.set(words[3], { name: words[4], bits: Number(words[2]), changes: [] });
    else if (line[0] === "#") time = Number(line.slice(1)) * unit;
    else {
      const long = words.length === 2 && /^[bBsSrR]/.test(line);
      const code = long ? words[1] : words[0].slice(1);
      const value = long ? words[0].slice(1) : words[0][0];
      const changes = variables.get(code)?.changes;
      if (changes && changes.at(-1)?.[1] !== value) changes.push([time, value]);
    }
  }
  return [...variables.values()];
}
