/* -- interpreter of the tables: the algorithm of SCXML 1.0, appendix D ------------------------------------------- */

static bool chart_inside(int index, int around)
{
    return around < index && index <= chart_nodes[around].last;
}

static bool chart_is_error(int event)
{
    for (int i = 0; i < CHART_ERRORS; i++) {
        if (chart_errors[i] == event) {
            return true;
        }
    }
    return false;
}

static struct chart_occurrence chart_occurred(int event)
{
    struct chart_occurrence occurrence;
    memset(&occurrence, 0, sizeof occurrence);
    occurrence.event = event;
    occurrence.node = occurrence.edge = -1;
    return occurrence;
}

static void chart_fire(struct chart *c, const struct chart_occurrence *occurrence)
{
    if (c->internal_count >= CHART_INTERNAL) {
        c->lost++;
        c->status |= CHART_LOST;
        return;
    }
    c->internal[(c->internal_first + c->internal_count++) % CHART_INTERNAL] = *occurrence;
}

static void chart_fire_event(struct chart *c, int event, const struct chart_attributes *data)
{
    struct chart_occurrence occurrence = chart_occurred(event);
    if (data) {
        occurrence.data = *data;
    }
    chart_fire(c, &occurrence);
}

static void chart_fail(struct chart *c, int failure)
{
    if (failure == CHART_OVERFLOWED) {
        c->status |= CHART_OVERFLOW;
    }
    chart_fire_event(c, CHART_ERROR_EVENT, NULL);
}

static void chart_arm(struct chart *c, int timer)
{
    const struct chart_num seconds = chart_seconds(c, timer);
    if (seconds.bad) {
        chart_fail(c, seconds.bad);
    } else if (seconds.value < 4e9) { /* others are never due: nanoseconds have 64 bits */
        c->armed[timer] = true;
        c->due[timer] = c->clock + (int64_t)(seconds.value * 1e9 + 0.5);
        c->order[timer] = ++c->orders;
    }
}

static void chart_stop(struct chart *c, int activity)
{
    c->running[activity] = false;
    if (chart_activities[activity].timer >= 0) {
        c->armed[chart_activities[activity].timer] = false;
    }
    if (c->host.stop) {
        c->host.stop(c->host.context, activity, c->run[activity]);
    }
}

static void chart_forget(struct chart *c, int node)
{
    int count = 0;
    for (int i = 0; i < c->kept_count; i++) {
        if (c->kept[i].node != node) {
            c->kept[count++] = c->kept[i];
        }
    }
    c->kept_count = count;
}

static void chart_keep(struct chart *c, const struct chart_occurrence *occurrence, int node)
{
    if (c->kept_count >= CHART_QUEUE) {
        c->lost++;
        c->status |= CHART_LOST;
        return;
    }
    struct chart_occurrence *kept = &c->kept[c->kept_count++];
    *kept = *occurrence;
    kept->node = node;
    kept->serial = c->serial[node];
    kept->exact = true;
}

/* -- selection of transitions */

static bool chart_is_leaf(const struct chart *c, int index)
{
    for (int inner = index + 1; inner <= chart_nodes[index].last; inner++) {
        if (c->active[inner]) {
            return false;
        }
    }
    return c->active[index];
}

/* Report the failure of a guard once in a macrostep, or once for an event. */
static bool chart_holds(struct chart *c, int edge)
{
    const int holds = chart_guard(c, chart_edges[edge].guard);
    if (holds >= 0) {
        return holds == 1;
    }
    const uint32_t mark = chart_edges[edge].each ? c->turn : c->macrostep;
    if (c->marks[edge] != mark + 1) {
        c->marks[edge] = mark + 1;
        chart_fail(c, holds);
    }
    return false;
}

static int chart_first_of(struct chart *c, int index, const struct chart_occurrence *occurrence)
{
    const struct chart_node *node = &chart_nodes[index];
    const int event = occurrence ? occurrence->event : 0;
    if (occurrence && occurrence->node >= 0 && index != occurrence->node) {
        if (occurrence->exact || !chart_inside(occurrence->node, index)) {
            return -1;
        }
    }
    if (occurrence && occurrence->edge >= 0) {
        return chart_holds(c, occurrence->edge) ? occurrence->edge : -1;
    }
    for (int i = node->trigger; i < node->trigger + node->triggers; i++) {
        if (chart_triggers[i].event == event && chart_holds(c, chart_triggers[i].edge)) {
            return chart_triggers[i].edge;
        }
    }
    return -1;
}

static int chart_first_enabled(struct chart *c, int leaf, const struct chart_occurrence *occurrence)
{
    for (int index = leaf; index > 0; index = chart_nodes[index].parent) {
        const int edge = chart_first_of(c, index, occurrence);
        if (edge >= 0) {
            return edge;
        }
    }
    return -1;
}

static bool chart_clears(const struct chart_edge *edge, int memory)
{
    for (int i = edge->clear; edge->targets && i < edge->clear + edge->cleared; i++) {
        if (chart_cleared[i] == memory) {
            return true;
        }
    }
    return false;
}

/* Write the nodes for which a target stands: the remembered nodes or the default of a history. */
static int chart_resolve(const struct chart *c, int target, const struct chart_edge *edge, int *real)
{
    const struct chart_node *node = &chart_nodes[target];
    int count = 0;
    if (node->memory < 0) {
        real[count++] = target;
    } else if (!c->known[node->memory] || (edge && chart_clears(edge, node->memory))) {
        real[count++] = node->default_node;
    } else {
        for (int i = 0; i < CHART_NODES; i++) {
            if (c->memory[node->memory][i]) {
                real[count++] = i;
            }
        }
    }
    return count;
}

/* The targets of an edge are in different regions, so that they stand for different nodes. */
static int chart_resolve_all(const struct chart *c, const struct chart_edge *edge, int *real)
{
    int some[CHART_NODES], count = 0;
    bool found[CHART_NODES] = {false};
    for (int t = edge->target; t < edge->target + edge->targets; t++) {
        const int more = chart_resolve(c, chart_targets[t], edge, some);
        for (int i = 0; i < more; i++) {
            if (!found[some[i]]) {
                found[some[i]] = true;
                real[count++] = some[i];
            }
        }
    }
    return count;
}

static bool chart_all_inside(const int *real, int count, int around)
{
    for (int i = 0; i < count; i++) {
        if (!chart_inside(real[i], around)) {
            return false;
        }
    }
    return true;
}

static int chart_domain(const struct chart *c, int number)
{
    const struct chart_edge *edge = &chart_edges[number];
    int real[CHART_NODES];
    const int count = chart_resolve_all(c, edge, real);
    if (edge->internal && chart_all_inside(real, count, edge->source)) {
        return edge->source;
    }
    int index = chart_nodes[edge->source].parent;
    while (index > 0) {
        const struct chart_node *node = &chart_nodes[index];
        if (!node->orthogonal && !node->transparent && chart_all_inside(real, count, index)) {
            break;
        }
        index = node->parent;
    }
    return index;
}

static bool chart_is_within(int one, int other)
{
    return chart_inside(chart_edges[one].source, chart_edges[other].source);
}

/* Whether the exit sets intersect: both contain active nodes, so one domain is in the other one. */
static bool chart_conflict(const struct chart *c, int one, int other)
{
    if (!chart_edges[one].targets || !chart_edges[other].targets) {
        return false;
    }
    const int a = chart_domain(c, one), b = chart_domain(c, other);
    return a == b || chart_inside(a, b) || chart_inside(b, a);
}

static void chart_add_without_conflicts(const struct chart *c, int candidate, int *kept, int *count)
{
    bool rival[CHART_NODES];
    int left = 0;
    for (int i = 0; i < *count; i++) {
        rival[i] = chart_conflict(c, candidate, kept[i]);
        if (rival[i] && !chart_is_within(candidate, kept[i])) {
            return;
        }
    }
    for (int i = 0; i < *count; i++) {
        if (!rival[i]) {
            kept[left++] = kept[i];
        }
    }
    kept[left++] = candidate;
    *count = left;
}

static bool chart_contains(const int *edges, int count, int edge)
{
    for (int i = 0; i < count; i++) {
        if (edges[i] == edge) {
            return true;
        }
    }
    return false;
}

static bool chart_is_preempted(const struct chart *c, int edge, const int *taken, int count)
{
    for (int i = 0; i < count; i++) {
        if (chart_is_within(taken[i], edge) && chart_conflict(c, taken[i], edge)) {
            return true;
        }
    }
    return false;
}

/* -- entries and completion */

static bool chart_is_child(int index, int of)
{
    return chart_nodes[index].parent == of && chart_nodes[index].memory < 0;
}

static void chart_add_content(const struct chart *c, int index, bool *entering, int *after);

static void chart_add_regions(const struct chart *c, int index, bool *entering, int *after)
{
    for (int child = index + 1; chart_nodes[index].orthogonal && child <= chart_nodes[index].last; child++) {
        if (chart_is_child(child, index) && !entering[child]) {
            entering[child] = true;
            chart_add_regions(c, child, entering, after);
            chart_add_content(c, child, entering, after);
        }
    }
}

/* Add the paths from `around` to the nodes for which the targets stand, then their default content. */
static void chart_add_ways(const struct chart *c, int around, const int *targets, int count, bool *entering,
                           int *after, bool *ways)
{
    int real[CHART_NODES];
    for (int t = 0; t < count; t++) {
        const struct chart_node *node = &chart_nodes[targets[t]];
        const int found = chart_resolve(c, targets[t], NULL, real);
        if (node->memory >= 0 && !c->known[node->memory]) {
            after[node->parent] = node->default_block;
        }
        for (int i = 0; i < found; i++) {
            for (int index = real[i]; index != around; index = chart_nodes[index].parent) {
                entering[index] = ways[index] = true;
            }
        }
    }
    for (int t = 0; t < count; t++) {
        const int found = chart_resolve(c, targets[t], NULL, real);
        for (int i = 0; i < found; i++) {
            chart_add_content(c, real[i], entering, after);
        }
    }
}

static void chart_add_content(const struct chart *c, int index, bool *entering, int *after)
{
    const int initial = chart_nodes[index].initial;
    bool ways[CHART_NODES] = {false};
    if (initial < 0) {
        return;
    }
    for (int child = index + 1; child <= chart_nodes[index].last; child++) {
        if (chart_is_child(child, index) && entering[child]) {
            return;
        }
    }
    chart_add_ways(c, index, &initial, 1, entering, after, ways);
    for (int inner = 0; inner < CHART_NODES; inner++) {
        if (ways[inner]) {
            chart_add_regions(c, inner, entering, after);
        }
    }
}

static void chart_complete(struct chart *c, int index)
{
    if (index == 0) {
        c->finished = true;
    } else if (chart_nodes[index].done) {
        struct chart_occurrence done = chart_occurred(chart_nodes[index].done);
        if (!CHART_SCXML) {
            done.node = index;
            done.serial = c->serial[index];
            done.exact = true;
        }
        chart_fire(c, &done);
    }
}

static bool chart_is_finished(const struct chart *c, int region);

static bool chart_all_finished(const struct chart *c, int around)
{
    for (int child = around + 1; child <= chart_nodes[around].last; child++) {
        if (chart_is_child(child, around) && !chart_is_finished(c, child)) {
            return false;
        }
    }
    return true;
}

static bool chart_has_final(const struct chart *c, int around)
{
    for (int child = around + 1; child <= chart_nodes[around].last; child++) {
        if (chart_is_child(child, around) && c->active[child] && chart_nodes[child].final) {
            return true;
        }
    }
    return false;
}

static bool chart_is_finished(const struct chart *c, int region)
{
    if (chart_nodes[region].transparent) {
        int within = region + 1;
        while (!chart_is_child(within, region)) {
            within++;
        }
        return chart_nodes[within].orthogonal ? chart_all_finished(c, within)
                                              : chart_has_final(c, region) || chart_has_final(c, within);
    }
    return chart_has_final(c, region);
}

static void chart_complete_around(struct chart *c, int index)
{
    const struct chart_node *node = &chart_nodes[index];
    if (!node->final) {
        if (node->immediate) {
            chart_complete(c, index);
        }
        return;
    }
    const int around = node->parent;
    if (around == 0 || chart_nodes[around].state) {
        chart_complete(c, around);
    }
    int region = chart_nodes[around].state ? chart_nodes[around].parent : around;
    bool ends = around > 0 && (region == around || chart_nodes[region].transparent);
    while (ends && chart_all_finished(c, chart_nodes[region].parent)) {
        chart_complete(c, chart_nodes[region].parent);
        region = chart_nodes[chart_nodes[region].parent].parent;
        ends = chart_nodes[region].transparent;
    }
}

static void chart_enter_node(struct chart *c, int index, int after)
{
    const struct chart_node *node = &chart_nodes[index];
    c->active[index] = true;
    c->waiting[index] = node->waits;
    c->serial[index]++;
    chart_block(c, node->entry);
    chart_block(c, after);
    for (int timer = 0; timer < CHART_TIMERS; timer++) {
        if (chart_timers[timer].node == index && chart_timers[timer].kind != CHART_WITHIN) {
            chart_arm(c, timer);
        }
    }
    chart_block(c, node->outcome);
    chart_complete_around(c, index);
}

/* Enter every node inside `around` that the targets need, outer nodes first. */
static void chart_enter(struct chart *c, int around, const int *targets, int count)
{
    bool entering[CHART_NODES] = {false}, ways[CHART_NODES] = {false}, first[CHART_NODES];
    int after[CHART_NODES] = {0};
    chart_add_ways(c, around, targets, count, entering, after, ways);
    memcpy(first, entering, sizeof first);
    for (int index = 0; index < CHART_NODES; index++) {
        if (first[index]) {
            chart_add_regions(c, index, entering, after);
        }
    }
    for (int index = 0; index < CHART_NODES; index++) {
        if (entering[index]) {
            chart_enter_node(c, index, after[index]);
        }
    }
}

/* -- exits and microsteps */

static void chart_exit_node(struct chart *c, int index, bool own)
{
    const struct chart_node *node = &chart_nodes[index];
    for (int timer = 0; timer < CHART_TIMERS; timer++) {
        if (chart_timers[timer].node == index && chart_timers[timer].kind != CHART_WITHIN) {
            c->armed[timer] = false;
        }
    }
    for (int activity = 0; activity < CHART_ACTIVITIES; activity++) {
        if (chart_activities[activity].node == index && c->running[activity]) {
            chart_stop(c, activity);
        }
    }
    chart_block(c, own ? node->leave : node->broken);
    c->active[index] = c->waiting[index] = false;
    chart_forget(c, index);
}

/* Remember the active nodes inside the parents of histories that are left. */
static void chart_remember(struct chart *c, const bool *leaving)
{
    for (int index = 1; index < CHART_NODES; index++) {
        const struct chart_node *node = &chart_nodes[index];
        if (node->memory < 0 || !leaving[node->parent]) {
            continue;
        }
        c->known[node->memory] = true;
        for (int one = 0; one < CHART_NODES; one++) {
            const bool kept = node->deep ? chart_inside(one, node->parent) && chart_is_leaf(c, one)
                                         : chart_is_child(one, node->parent) && c->active[one];
            c->memory[node->memory][one] = kept;
        }
    }
}

/* Exit nodes, inner nodes first; nodes outside `own` are interrupted. */
static void chart_exit(struct chart *c, const bool *leaving, const bool *own)
{
    chart_remember(c, leaving);
    for (int index = CHART_NODES - 1; index > 0; index--) {
        if (leaving[index]) {
            chart_exit_node(c, index, own[index]);
        }
    }
}

static void chart_microstep(struct chart *c, const int *taken, int count)
{
    bool leaving[CHART_NODES] = {false}, own[CHART_NODES] = {false};
    for (int i = 0; i < count; i++) {
        if (chart_edges[taken[i]].targets) {
            const int around = chart_domain(c, taken[i]), source = chart_edges[taken[i]].source;
            for (int index = around + 1; index <= chart_nodes[around].last; index++) {
                leaving[index] = leaving[index] || c->active[index];
            }
            own[source] = own[source] || source != around;
        }
    }
    chart_exit(c, leaving, own);
    for (int i = 0; i < count; i++) {
        chart_block(c, chart_edges[taken[i]].effect);
    }
    for (int i = 0; i < count; i++) {
        const struct chart_edge *edge = &chart_edges[taken[i]];
        for (int j = edge->clear; j < edge->clear + edge->cleared; j++) {
            c->known[chart_cleared[j]] = false;
        }
    }
    for (int i = 0; i < count; i++) {
        const struct chart_edge *edge = &chart_edges[taken[i]];
        if (edge->targets) {
            chart_enter(c, chart_domain(c, taken[i]), &chart_targets[edge->target], edge->targets);
        }
    }
}

/* Keep the event for the states whose least time has not passed; return whether there are any. */
static bool chart_keep_late(struct chart *c, const struct chart_occurrence *occurrence, const int *late, int lates,
                            const int *taken, int count)
{
    bool kept[CHART_NODES] = {false}, any = false;
    if (!occurrence || occurrence->periodic) {
        return false;
    }
    for (int i = 0; i < lates; i++) {
        const int source = chart_edges[late[i]].source;
        if (!kept[source] && !chart_is_preempted(c, late[i], taken, count)) {
            kept[source] = any = true;
            chart_keep(c, occurrence, source);
        }
    }
    return any;
}

/* Run one microstep if transitions are enabled; keep the event for states whose least time has not passed. */
static bool chart_react(struct chart *c, const struct chart_occurrence *occurrence)
{
    int found[CHART_NODES], late[CHART_NODES], taken[CHART_NODES], founds = 0, lates = 0, count = 0;
    for (int leaf = 1; leaf < CHART_NODES; leaf++) {
        if (chart_is_leaf(c, leaf)) {
            const int edge = chart_first_enabled(c, leaf, occurrence);
            if (edge >= 0 && !chart_contains(found, founds, edge)) {
                found[founds++] = edge;
            }
        }
    }
    for (int i = 0; i < founds; i++) {
        if (chart_edges[found[i]].targets && c->waiting[chart_edges[found[i]].source]) {
            late[lates++] = found[i];
        } else {
            chart_add_without_conflicts(c, found[i], taken, &count);
        }
    }
    const bool keeps = chart_keep_late(c, occurrence, late, lates, taken, count);
    if (!count) {
        return keeps;
    }
    if (c->microsteps >= CHART_MAX_MICROSTEPS) {
        c->status |= CHART_RUNAWAY;
        c->finished = true;
        return false;
    }
    c->microsteps++;
    chart_microstep(c, taken, count);
    return true;
}

/* -- events */

static bool chart_take(struct chart *c, const struct chart_occurrence *occurrence)
{
    const int node = occurrence->node;
    c->event = occurrence->data;
    if (!chart_is_error(occurrence->event)) {
        c->turn++;
    }
    if (node >= 0 && !(c->active[node] && c->serial[node] == occurrence->serial)) {
        return false;
    }
    return chart_react(c, occurrence);
}

/* Take transitions without trigger, then handle internal events, until neither is left. */
static void chart_rest(struct chart *c)
{
    while (!c->finished) {
        if (chart_react(c, NULL)) {
            continue;
        }
        if (!c->internal_count) {
            return;
        }
        const struct chart_occurrence occurrence = c->internal[c->internal_first];
        c->internal_first = (c->internal_first + 1) % CHART_INTERNAL;
        c->internal_count--;
        if (!chart_take(c, &occurrence) && chart_is_error(occurrence.event) && !CHART_SCXML) {
            c->failed = true;
        }
    }
}

static void chart_begin(struct chart *c)
{
    c->macrostep++;
    c->microsteps = 0;
}

/* End the controller if its plot has ended, or after a failure that nothing handles. */
static void chart_finish(struct chart *c)
{
    bool leaving[CHART_NODES], own[CHART_NODES] = {false};
    if (!c->failed && !c->finished) {
        return;
    }
    if (!c->finished) {
        memset(&c->event, 0, sizeof c->event);
        c->internal_count = 0;
    }
    memcpy(leaving, c->active, sizeof leaving);
    chart_exit(c, leaving, own);
    for (int i = 0; i < c->internal_count && !CHART_SCXML; i++) {
        if (chart_is_error(c->internal[(c->internal_first + i) % CHART_INTERNAL].event)) {
            c->failed = true;
        }
    }
    if (c->failed) {
        c->status |= CHART_FAILED;
    }
    c->ended = true;
}

/* Handle the outcome of an activity; an outcome that an active state ignores ends the controller. */
static void chart_end_activity(struct chart *c, int activity, struct chart_occurrence *occurrence)
{
    const int node = chart_activities[activity].node;
    c->running[activity] = false;
    if (chart_activities[activity].timer >= 0) {
        c->armed[chart_activities[activity].timer] = false;
    }
    occurrence->node = node;
    occurrence->serial = c->serial[node];
    chart_begin(c);
    const bool handled = chart_take(c, occurrence);
    chart_rest(c);
    if (!handled && c->active[node] && c->serial[node] == occurrence->serial) {
        c->failed = true;
    }
    chart_finish(c);
}

static void chart_handle(struct chart *c, struct chart_occurrence *occurrence)
{
    if (!occurrence->run) {
        chart_begin(c);
        chart_take(c, occurrence);
        chart_rest(c);
        chart_finish(c);
        return;
    }
    for (int activity = 0; activity < CHART_ACTIVITIES; activity++) {
        if (c->running[activity] && c->run[activity] == occurrence->run) {
            chart_end_activity(c, activity, occurrence);
            return;
        }
    }
}

/* Enable the transitions of a state whose least time has passed; first offer the state its kept events. */
static void chart_enable(struct chart *c, int node)
{
    memset(&c->event, 0, sizeof c->event);
    c->turn++;
    c->waiting[node] = false;
    for (int i = 0; i < c->kept_count; i++) {
        if (c->kept[i].node == node) {
            chart_fire(c, &c->kept[i]);
        }
    }
    chart_forget(c, node);
}

static void chart_time_out(struct chart *c, int number)
{
    const struct chart_timer *timer = &chart_timers[number];
    struct chart_occurrence occurrence = chart_occurred(0);
    c->armed[number] = false;
    c->clock = c->due[number] > c->clock ? c->due[number] : c->clock;
    if (timer->kind == CHART_WITHIN) {
        occurrence.event = CHART_TIMED_OUT;
        chart_stop(c, timer->activity);
        chart_end_activity(c, timer->activity, &occurrence);
        return;
    }
    const uint32_t serial = c->serial[timer->node];
    chart_begin(c);
    if (timer->kind == CHART_AT_LEAST) {
        chart_enable(c, timer->node);
    } else {
        occurrence.node = timer->node;
        occurrence.serial = serial;
        occurrence.exact = true;
        occurrence.edge = timer->edge;
        occurrence.periodic = timer->kind == CHART_EVERY;
        chart_take(c, &occurrence);
    }
    if (timer->kind == CHART_EVERY && c->active[timer->node] && c->serial[timer->node] == serial) {
        chart_arm(c, number);
    }
    chart_rest(c);
    chart_finish(c);
}

static int chart_next_due(const struct chart *c, int64_t now_ns)
{
    int first = -1;
    for (int timer = 0; timer < CHART_TIMERS; timer++) {
        if (c->armed[timer] && c->due[timer] <= now_ns) {
            if (first < 0 || c->due[timer] < c->due[first]
                || (c->due[timer] == c->due[first] && c->order[timer] < c->order[first])) {
                first = timer;
            }
        }
    }
    return first;
}

/* -- interface */

int chart_init(struct chart *c, const struct chart_host *host, const struct chart_parameters *parameters,
               int64_t now_ns)
{
    memset(c, 0, sizeof *c);
    c->host = *host;
    c->clock = now_ns;
    const int bad = chart_fill(c, parameters);
    if (bad) {
        c->ended = true;
        return c->status = bad == CHART_OVERFLOWED ? CHART_FAILED | CHART_OVERFLOW : CHART_FAILED;
    }
    chart_begin(c);
    chart_enter(c, 0, &chart_nodes[0].initial, 1);
    chart_rest(c);
    chart_finish(c);
    return c->status;
}

int chart_end(struct chart *c, uint32_t run, int event, const struct chart_attributes *data)
{
    if (c->ended || event < CHART_FIRST_EVENT || event >= CHART_EVENTS || (data && !chart_fits(data))) {
        return CHART_UNKNOWN;
    }
    if (c->queue_count >= CHART_QUEUE) {
        c->dropped++;
        return CHART_FULL;
    }
    struct chart_occurrence *occurrence = &c->queue[(c->queue_first + c->queue_count++) % CHART_QUEUE];
    *occurrence = chart_occurred(event);
    occurrence->run = run;
    if (data) {
        occurrence->data = *data;
    }
    return CHART_OK;
}

int chart_post(struct chart *c, int event, const struct chart_attributes *data)
{
    return chart_end(c, 0, event, data);
}

int chart_step(struct chart *c, int64_t now_ns)
{
    c->status = CHART_OK;
    for (int i = 0; i < CHART_MAX_EVENTS; i++) {
        if (c->ended) {
            return c->status;
        }
        const int timer = chart_next_due(c, now_ns);
        if (timer >= 0) {
            chart_time_out(c, timer);
            continue;
        }
        c->clock = now_ns > c->clock ? now_ns : c->clock;
        if (!c->queue_count) {
            return c->status;
        }
        struct chart_occurrence occurrence = c->queue[c->queue_first];
        c->queue_first = (c->queue_first + 1) % CHART_QUEUE;
        c->queue_count--;
        chart_handle(c, &occurrence);
    }
    if (!c->ended && (c->queue_count || chart_next_due(c, now_ns) >= 0)) {
        c->status |= CHART_BUSY;
    }
    return c->status;
}

int chart_configuration(const struct chart *c, int states[CHART_NODES])
{
    int count = 0;
    for (int index = 0; index < CHART_NODES; index++) {
        if (c->active[index] && chart_nodes[index].state) {
            states[count++] = index;
        }
    }
    return count;
}
