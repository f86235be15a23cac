// @ts-check
// Adds a copy button to each code block, keeps long cells wide, and lets the search work in local files.
"use strict";

// Excerpts below search results are fetched from the pages; browsers refuse this for local files.
if (location.protocol === "file:") DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;

// The text that the button copies: for a console block, only the commands, without prompts.
function textOf(block) {
  const text = block.querySelector("pre").textContent;
  if (!block.closest(".highlight-console")) return text;
  const commands = [];
  let goesOn = false;
  for (const line of text.split("\n")) {
    if (line.startsWith("$ ") || goesOn) {
      commands.push(goesOn ? line : line.slice(2));
      goesOn = line.endsWith("\\");
    }
  }
  return commands.join("\n") + "\n";
}

async function copy(text) {
  if (navigator.clipboard) return navigator.clipboard.writeText(text);
  const area = document.body.appendChild(document.createElement("textarea"));
  area.value = text;
  area.select();
  document.execCommand("copy");
  area.remove();
}

document.addEventListener("DOMContentLoaded", () => {
  for (const cell of document.querySelectorAll("td")) {
    cell.classList.toggle("long", cell.textContent.length > 60);
  }
  // Make scrolling blocks reachable by keyboard, and give captions in the sidebar a heading level.
  for (const scrolled of document.querySelectorAll("pre, .table-wrapper")) scrolled.tabIndex = 0;
  for (const caption of document.querySelectorAll(".caption[role=heading]")) caption.ariaLevel = "2";
  for (const block of document.querySelectorAll("div.highlight")) {
    const button = block.appendChild(document.createElement("button"));
    button.type = "button";
    button.className = "copy";
    button.textContent = "Copy";
    button.addEventListener("click", async () => {
      await copy(textOf(block));
      button.textContent = "Copied";
      setTimeout(() => (button.textContent = "Copy"), 1500);
    });
  }
});
