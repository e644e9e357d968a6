// Named values of fields.

// The name of the field's value in a frame; undefined if it has none.
export function valueName(field, values) {
  const value = Number(values[field.name]);
  const [other, sets] = field.choices_by ?? [];
  const choices = field.choices ?? sets?.[Number(values[other])] ?? {};
  return Object.keys(choices).find((name) => choices[name] === value);
}

export function hasNames(field) {
  return Boolean(field.choices ?? field.choices_by);
}
