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

}  // namespace ricochet::detail
