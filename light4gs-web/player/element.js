export class L4gsPlayer extends HTMLElement {}
