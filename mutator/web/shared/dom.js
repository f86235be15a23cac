// @ts-check
"use strict";
// Creates elements in one expression. Strings become text, never markup.

const Dom = (() => {
  /** An element: `el("a.link", {href, onclick}, "text", child, [more])`. Null attributes and children are left out. */
  function el(what, attributes = {}, ...children) {
    const [tag, ...classes] = what.split(".");
    const element = document.createElement(tag);
    if (classes.length) element.className = classes.join(" ");
    for (const [name, value] of Object.entries(attributes)) {
      if (value === null || value === undefined || value === false) continue;
      if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
      else if (name === "style") element.style.cssText = value; // a content security policy forbids the attribute
      else element.setAttribute(name, value === true ? "" : value);
    }
    element.append(...children.flat(Infinity).filter((c) => c !== null && c !== undefined && c !== false));
    return element;
  }

  /** An SVG element. */
  function svg(tag, attributes = {}, ...children) {
    const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...children.flat(Infinity));
    return element;
  }

  /** A button that copies the result of `text()` and confirms it. */
  function copyButton(text, label = "Copy") {
    const button = el("button.copy", { type: "button", onclick: copy }, label);
    async function copy() {
      try {
        await navigator.clipboard.writeText(text());
        button.textContent = "Copied";
      } catch {
        button.textContent = "Press Ctrl+C";
        select(button.parentElement.querySelector("code"));
      }
      setTimeout(() => (button.textContent = label), 1500);
    }
    return button;
  }

  /** Select the text of an element, so that the user can copy it if the page is not allowed to. */
  function select(element) {
    if (element) getSelection().selectAllChildren(element);
  }

  /** A text in which no line is broken between a number and its unit; what users copy into a shell keeps its spaces. */
  function bound(text) {
    return text.replace(/(?<=\d) (?!(?:and|in|of|or|to) )(?=[a-z%°][\w/^²]{0,4}(?![\w/]))/gi, "\u00a0");
  }

  return { el, svg, copyButton, bound };
})();
