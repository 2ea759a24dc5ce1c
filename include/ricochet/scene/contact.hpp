// Lasting contact of the bodies of a scene: stacks, sleeping bodies that lean on each other, chains
// over an edge. Requires the contact solver; link the separate library `ricochet::scene_contact`.
#pragma once

#include "ricochet/scene/simulate.hpp"

namespace ricochet {

/// Solver of lasting contacts, by Moreau's time stepping with steps `SceneOptions::contact_step`:
///
///     simulate(scene, {.t_end = 10, .contacts = scene_contacts()})
///
/// Never null; valid as long as the program runs.
[[nodiscard]] const SceneContacts* scene_contacts() noexcept;

}  // namespace ricochet
