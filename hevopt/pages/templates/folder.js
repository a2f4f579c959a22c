"use strict";
// An index has tables that sort and no figures.
Page.start(() => {});
