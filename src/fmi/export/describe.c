/* ricochet-fmu-describe LIBRARY VERSION FILE: writes the description that the library of an FMU
 * gives. */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef const char* Describe(int version);

int main(int count, char** arguments)
{
    void* library;
    void* symbol;
    Describe* describe;
    const char* text;
    FILE* file;
    if (count != 4)
        return fprintf(stderr, "usage: ricochet-fmu-describe LIBRARY VERSION FILE\n"), 2;
    library = dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) return fprintf(stderr, "ricochet-fmu-describe: %s\n", dlerror()), 1;
    symbol = dlsym(library, "ricochet_fmu_description");
    if (!symbol)
        return fprintf(stderr, "ricochet-fmu-describe: %s has no RICOCHET_FMU\n", arguments[1]), 1;
    memcpy(&describe, &symbol, sizeof describe);
    text = describe(atoi(arguments[2]));
    if (!*text) return fprintf(stderr, "ricochet-fmu-describe: the model cannot be described\n"), 1;
    file = fopen(arguments[3], "w");
    if (!file || fputs(text, file) < 0 || fclose(file)) return perror(arguments[3]), 1;
    return 0;
}
