/** A scene in an engine: what every adapter gives. */
export interface Splats<Engine> {
  /** What the engine has in its scene: place, turn and scale it as any other. */
  object: Engine;
  /** Says which time is wanted, in [0, 1] of a scene and in seconds of a take: for each frame. Settles when the newest has been given to the engine. */
  update(time: number): Promise<void>;
  /** The time that the engine has. */
  readonly time: number;
  /** Takes it out of the engine. The scene stays open. */
  dispose(): void;
}
