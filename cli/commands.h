// The subcommands. Each is one file in cli/commands, which adds its options to the command line and
// says what to do when it is named.
#pragma once

#include "cli/command_line.h"

namespace angiospline::cli {

void add_recover(CommandLine& line);
void add_seed(CommandLine& line);
void add_fit(CommandLine& line);
void add_segment(CommandLine& line);
void add_thin(CommandLine& line);
void add_graph(CommandLine& line);
void add_smooth(CommandLine& line);
void add_check(CommandLine& line);
void add_compare(CommandLine& line);
void add_compare_masks(CommandLine& line);
void add_convert(CommandLine& line);
void add_phantom(CommandLine& line);
void add_reproduce(CommandLine& line);

// In the order in which help lists them.
inline constexpr void (*kCommands[])(CommandLine&) = {
    add_recover, add_seed,    add_fit,       add_segment, add_thin,
    add_graph,   add_smooth,  add_check,     add_compare, add_compare_masks,
    add_convert, add_phantom, add_reproduce,
};

}  // namespace angiospline::cli
