// Loads scripts of the pages, in the order of their names, and returns the constants that they declare.
import { readFileSync } from "node:fs";
import { runInThisContext } from "node:vm";

const WEB = new URL("../../../../mutator/web/", import.meta.url);

export function load(...names) {
  const declared = names.flatMap((name) => {
    const text = readFileSync(new URL(name, WEB), "utf8");
    runInThisContext(text, { filename: name });
    return [...text.matchAll(/^(?:const|class) (\w+)/gm)].map(([, constant]) => constant);
  });
  return runInThisContext(`({ ${declared} })`);
}
