import { computed, effect, signal } from "@preact/signals";
import { kept } from "./keep";

export type Choice = "system" | "light" | "dark";

export const choice = kept<Choice>("theme", "system");
const system = matchMedia("(prefers-color-scheme: dark)");
const system_dark = signal(system.matches);
system.addEventListener("change", () => (system_dark.value = system.matches));

export const theme = computed(() => (choice.value === "system" ? (system_dark.value ? "dark" : "light") : choice.value));
effect(() => {
  document.documentElement.dataset.theme = theme.value;
});
