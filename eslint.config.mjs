// Rules for the pages' scripts. A script may use the constants of all scripts that its pages load (order.txt).
import { readFileSync } from "node:fs";
import js from "@eslint/js";
import globals from "globals";

const WEB = "mutator/web", PAGES = ["comparison", "report", "review", "serve", "golden", "trial"];
const lines = (file) => readFileSync(`${WEB}/${file}`, "utf8").trim().split("\n");
const orders = PAGES.map((page) => lines(`${page}/order.txt`).filter((name) => name.endsWith(".js")));
for (const page of [3, 5]) orders[page].unshift(...orders[1]); // the server adds its scripts to a report, or to most of its scripts

/** The constants of the scripts that are in every page with scripts of `folder`. */
function constants(folder) {
  const [first, ...others] = orders.filter((order) => order.some((name) => name.startsWith(`${folder}/`)));
  const names = first.filter((name) => others.every((order) => order.includes(name)))
    .flatMap((file) => lines(file).flatMap((line) => line.match(/^(?:const|class|var) (\w+)/)?.[1] ?? []));
  return Object.fromEntries(names.map((name) => [name, "readonly"]));
}

/** Names that say what happened to a value instead of what it is. `left` is missing, because it is also a direction. */
const EMPTY_NAMES = ("found known told made seen own wanted given kept held said asked shown taken put gone meant heard done one thing things " +
  "stuff theirs ours they it says").split(" ");
const nameRules = { "id-denylist": ["error", ...EMPTY_NAMES] };

const rules = {
  ...nameRules,
  eqeqeq: "error",
  "no-redeclare": ["error", { builtinGlobals: false }], // each script declares one of those constants
  "no-shadow": "off",
  "no-unused-vars": ["error", { vars: "local", args: "all", argsIgnorePattern: "^_$" }],
  "no-use-before-define": ["error", { functions: false, classes: false, variables: false }],
  "no-var": "error",
  "prefer-const": ["error", { destructuring: "all" }],
  strict: ["error", "global"],
};

export default [
  js.configs.recommended,
  { ignores: ["**/*.js", "!mutator/web/**", "!docs/_static/*", "mutator/web/uplot/*"] },
  ...["shared", "replay", ...PAGES].map((folder) => ({
    files: [`${WEB}/${folder}/*.js`],
    languageOptions: { sourceType: "script", globals: { ...globals.browser, ...constants(folder) } },
    rules,
  })),
  { files: ["docs/_static/*.js"], languageOptions: { sourceType: "script", globals: { ...globals.browser, DOCUMENTATION_OPTIONS: "readonly" } }, rules },
  { files: ["**/*.mjs"], languageOptions: { globals: globals.node }, rules: nameRules },
];
