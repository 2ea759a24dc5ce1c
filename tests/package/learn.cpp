// A user of the component `learn`: a tenth of the states is held out.
#include <array>
#include <cstdio>

#include "ricochet/learn/classifier.hpp"
#include "ricochet/learn/data_set.hpp"

int main()
{
    ricochet::learn::DataSet data{.columns = {{"height", "m"}}};
    for (int i = 0; i < 100; ++i) {
        const double height = i / 100.0;
        data.append(std::array{height}, height < 0.5, height - 0.5);
    }
    const ricochet::learn::Split split = ricochet::learn::split(data, 0.1, 1);
    const bool fine = split.held_out.size() == 10 && split.kept.events() == 45;
    std::puts(fine ? "fine" : "not held out");
    return fine ? 0 : 1;
}
