#include "core/event_search.hpp"

#include <algorithm>

namespace ricochet::detail {

void sort_notes_until(double s, std::vector<Note>& notes)
{
    std::erase_if(notes, [&](const Note& note) { return note.where.root > s; });
    // std::stable_sort would allocate.
    std::sort(notes.begin(), notes.end(), [](const Note& a, const Note& b) {
        return a.where.root != b.where.root ? a.where.root < b.where.root : a.guard < b.guard;
    });
}

void bisect(GuardPath& path, GuardSample& lo, GuardSample& hi, double tolerance)
{
    while (hi.s - lo.s > std::max(tolerance, path.finest(hi.s))) {
        const double middle = lo.s + (hi.s - lo.s) / 2;
        if (middle <= lo.s || middle >= hi.s) break;
        const GuardSample sample = path.value(middle);
        (path.has_left(sample) ? hi : lo) = sample;
    }
}

}  // namespace ricochet::detail
